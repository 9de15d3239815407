"""What cannot be loaded is said in one sentence, and never reaches a parser that would crash on it."""

import random
import re

import pytest

from skillframe.errors import InputError, SkillframeError
from skillframe.robot.audit import audit
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.robot.urdf import read_urdf

BROKEN = {
    "empty file": (lambda u: "", "is empty"),
    "only blanks": (lambda u: " \n\t", "is empty"),
    "no XML": (lambda u: "solid mesh", "not valid XML"),
    "cut off": (lambda u: u.tree(0, 3)[:-20], "not valid XML"),
    "crossed tags": (lambda u: u.robot("<link name='a'></joint>"), "not valid XML"),
    "another format": (lambda u: "<sdf version='1.7'/>", "SDF"),
    "a mujoco model": (lambda u: "<mujoco/>", "MuJoCo"),
    "a web page": (lambda u: "<html></html>", "must be <robot>"),
    "an unprocessed xacro": (lambda u: u.robot("<xacro:include filename='x'/>"), "xacro"),
    "xacro arguments": (lambda u: u.robot('<link name="${prefix}base"/>'), "xacro"),
    "a document type": (lambda u: "<!DOCTYPE robot>" + u.tree(0, 1).split("?>")[1], "document type"),
    "no link": (lambda u: u.robot(), "no link"),
    "a link without a name": (lambda u: u.robot("<link/>"), "without a name"),
    "two links of one name": (lambda u: u.robot(u.link("a"), u.link("a")), "two links named 'a'"),
    "two joints of one name": (
        lambda u: u.robot(u.link("a"), u.link("b"), u.link("c"), u.joint("j", "a", "b"), u.joint("j", "a", "c")),
        "two joints named 'j'",
    ),
    "an unknown joint type": (lambda u: u.robot(u.link("a"), u.link("b"), u.joint("j", "a", "b", "ball")), "'ball'"),
    "a type in capitals": (lambda u: u.robot(u.link("a"), u.link("b"), u.joint("j", "a", "b", "Revolute")), "Revolute"),
    "a missing child": (lambda u: u.robot(u.link("a"), u.joint("j", "a", "b")), "unknown link 'b'"),
    "a missing parent": (lambda u: u.robot(u.link("base"), u.joint("j", "bsae", "base")), "did you mean 'base'"),
    "no parent tag": (
        lambda u: u.robot(u.link("a"), '<joint name="j" type="fixed"><child link="a"/></joint>'),
        "no parent",
    ),
    "two roots": (lambda u: u.robot(u.link("a"), u.link("b")), "2 root links"),
    "two parents": (
        lambda u: u.robot(u.link("a"), u.link("b"), u.link("c"), u.joint("j", "a", "c"), u.joint("k", "b", "c")),
        "child of two joints",
    ),
    "a cycle": (lambda u: u.robot(u.link("a"), u.link("b"), u.joint("j", "a", "b"), u.joint("k", "b", "a")), "cycle"),
    "a cycle beside a root": (
        lambda u: u.robot(u.link("r"), u.link("a"), u.link("b"), u.joint("j", "a", "b"), u.joint("k", "b", "a")),
        "cycle",
    ),
    "a joint onto itself": (lambda u: u.robot(u.link("a"), u.joint("j", "a", "a")), "cycle"),
    "a mass that is text": (lambda u: u.tree(0, 2).replace('<mass value="', '<mass value="x'), "finite number"),
    "a mass that is NaN": (lambda u: u.robot(u.link("a", u.inertial(float("nan"), 1.0))), "finite number"),
    "an axis of two numbers": (
        lambda u: u.robot(u.link("a"), u.link("b"), u.joint("j", "a", "b", axis="0 1")),
        "3 finite",
    ),
    "a decimal comma": (lambda u: u.robot(u.link("a"), u.link("b"), u.joint("j", "a", "b", xyz="0 0 0,3")), "3 finite"),
    "an inertia without izz": (lambda u: u.tree(0, 1).replace("izz=", "jzz="), "no 'izz'"),
    "a box without size": (lambda u: u.robot(u.link("a", "<visual><geometry><box/></geometry></visual>")), "no 'size'"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_file_is_refused_in_one_sentence_that_names_it(save, urdf, capfd, kind):
    write, sentence = BROKEN[kind]
    path = save(write(urdf))
    with pytest.raises(InputError, match=sentence) as error:
        load_model(load_robot(path))
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    assert capfd.readouterr().err == ""


def test_an_entity_bomb_is_refused_before_it_expands(save):
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12)
    )
    with pytest.raises(InputError, match="document type"):
        read_urdf(save(f'{bomb}]><robot name="r"><link name="&m;"/></robot>'))


def test_binary_files_folders_and_wrong_encodings_are_refused(tmp_path):
    for name, content in {
        "a.urdf": b"\x00\x01\x7fELF" * 50,
        "b.urdf": b"\xff\xfe\x00\xd8" * 9,
        "c.urdf": b"\x80\x81<robot/>",
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError):
            read_urdf(tmp_path / name)
    with pytest.raises(InputError, match="folder"):
        read_urdf(tmp_path)


def test_a_chain_too_deep_for_any_parser_is_refused(save, urdf):
    parts = [urdf.link("l0")]
    for i in range(5000):
        parts += [urdf.link(f"l{i + 1}"), urdf.joint(f"j{i}", f"l{i}", f"l{i + 1}", "fixed", inside="")]
    with pytest.raises(InputError, match="chain of more than"):
        read_urdf(save(urdf.robot(*parts)))


def test_undeclared_prefixes_and_foreign_elements_do_no_harm(save, urdf):
    text = urdf.tree(1, 3).replace(
        "</robot>", '<gazebo><sensor:camera x="1"/></gazebo><transmission name="t"/></robot>'
    )
    assert load_model(load_robot(save(text))).model.nv == 3


def test_a_default_namespace_and_utf16_do_no_harm(tmp_path, urdf):
    text = urdf.tree(1, 3).replace("<robot ", '<robot xmlns="http://example.org/urdf" ')
    (tmp_path / "wide.urdf").write_bytes(text.replace('"1.0"', '"1.0" encoding="utf-16"').encode("utf-16"))
    assert load_model(load_robot(tmp_path / "wide.urdf")).model.nv == 3


def test_a_damaged_file_is_refused_or_judged_and_never_raises_anything_else(save, urdf):
    rng = random.Random(0)
    for case in range(120):
        text = urdf.tree(case, rng.randrange(1, 5), kinds=("revolute", "prismatic", "fixed", "planar"))
        place, harm = rng.randrange(len(text)), case % 4
        if harm == 0:  # a piece is lost
            text = text[:place] + text[place + rng.randrange(1, 40) :]
        elif harm == 1:  # a character is typed
            text = text[:place] + rng.choice('"<>&-e.9 ') + text[place:]
        else:  # attributes are exchanged, or are extreme numbers
            values = re.findall(r'="[^"]*"', text)
            others = values if harm == 2 else ['="1e308"', '="-5"', '="0"', '="1e-320"', '="nan"', '=""']
            text = text.replace(rng.choice(values), rng.choice(others), 1)
        try:
            audit(load_robot(save(text)))
        except SkillframeError as error:
            assert "\n" not in str(error)  # noqa: PT017
