import pytest
from skillframe_testkit.suites import HoldSkill, example_demonstrations

from skillframe.document.file import SkillSource, learned, load_skill, parse_source, save
from skillframe.errors import InputError, UnknownName
from skillframe.extend import LearnOptions, SkillType
from skillframe.extend.reading import write_demonstration


@pytest.fixture
def folder(tmp_path):
    for i, demonstration in enumerate(example_demonstrations(), 1):
        write_demonstration(demonstration, tmp_path / f"demo{i}.npz")
    return tmp_path


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("peg.skill.json", "peg"),
        ("results/peg.skill.json", "peg"),
        ("peg.json", "peg"),
        ("replay:demo1.npz", "replay"),
        ("lmc:a/b.npz,c.npz", "lmc"),
    ],
)
def test_a_skill_is_called_after_its_file_or_its_kind(text, name):
    assert parse_source(text).name == name


def test_a_kind_that_is_not_learned_says_so():
    kind = SkillType(name="hold", summary="", build=lambda document: HoldSkill())
    with pytest.raises(InputError, match="hold: is not learned from demonstrations"):
        learned(kind, example_demonstrations())


def test_the_learner_gets_the_options_and_the_document_tells_its_sources(folder):
    seen = []

    def learn(demonstrations, options):
        seen.append(options)
        frame = {"work_at": [0, 0, 0], "learned_at": [0, 0, 0], "center_of_compliance": [0, 0, 0], "axes": options.axes}
        return {"frame": frame, "phases": []}

    kind = SkillType(name="any", summary="", build=lambda document: HoldSkill(), learn=learn)
    document = learned(kind, example_demonstrations(), LearnOptions(axes="phase_start"))
    assert seen[0].axes == "phase_start"
    assert len(document["learned_from"]) == 2


def test_an_unknown_kind_is_refused_by_name(folder):
    with pytest.raises(UnknownName, match="unknown skill 'no_such_kind'"):
        load_skill("no_such_kind:demo1.npz", folder)


def test_a_file_that_is_missing_is_refused_by_name(folder):
    with pytest.raises(InputError, match=r"gone\.skill\.json: no such file"):
        load_skill("gone.skill.json", folder)


@pytest.mark.needs_plugins
def test_a_kind_and_a_demonstration_are_learned_in_memory(folder):
    name, document = load_skill("replay:demo1.npz", folder)
    assert (name, document["type"]) == ("replay", "replay")
    assert document["learned_from"][0]["file"] == str(folder / "demo1.npz")
    assert document["phases"][0]["mode"] == "shifted"


@pytest.mark.needs_plugins
def test_settings_follow_the_files(folder):
    _, document = load_skill("replay:demo1.npz,mode=absolute,stiffness_translation=500", folder)
    assert document["phases"][0]["mode"] == "absolute"
    assert document["phases"][0]["stiffness"]["translation"] == 500.0


@pytest.mark.needs_plugins
def test_an_unknown_setting_is_refused_with_the_nearest(folder):
    with pytest.raises(InputError, match="did you mean 'mode'"):
        load_skill("replay:demo1.npz,mod=absolute", folder)


@pytest.mark.needs_plugins
def test_a_kind_without_a_demonstration_is_refused(folder):
    with pytest.raises(InputError, match="names no demonstration"):
        load_skill("replay:", folder)


@pytest.mark.needs_plugins
def test_a_missing_demonstration_is_refused_by_name(folder):
    with pytest.raises(InputError, match=r"demo9\.npz"):
        load_skill("replay:demo9.npz", folder)


@pytest.mark.needs_plugins
def test_a_skill_file_gives_the_same_document_as_learning_in_memory(folder):
    _, document = load_skill("replay:demo1.npz", folder)
    save(document, folder / "again.skill.json")
    assert load_skill("again.skill.json", folder) == ("again", document)


@pytest.mark.needs_plugins
def test_paths_are_relative_to_the_folder_given_or_else_to_the_working_directory(folder, monkeypatch):
    monkeypatch.chdir(folder)
    _, here = load_skill("replay:demo1.npz")
    _, there = load_skill("replay:demo1.npz", folder)
    assert here["trajectory"] == there["trajectory"]


@pytest.mark.needs_plugins
def test_a_file_whose_name_holds_a_colon_is_still_a_file(folder):
    _, document = load_skill("replay:demo1.npz", folder)
    save(document, folder / "a:b.skill.json")
    assert load_skill("a:b.skill.json", folder) == ("a:b", document)


AWKWARD = {
    # text: what it names where all of FILES exist
    "peg.skill.json": SkillSource("", ("peg.skill.json",)),
    "v1:peg.skill.json": SkillSource("", ("v1:peg.skill.json",)),
    "my peg.skill.json": SkillSource("", ("my peg.skill.json",)),
    "a=b,c.skill.json": SkillSource("", ("a=b,c.skill.json",)),
    "C:\\peg.skill.json": SkillSource("", ("C:\\peg.skill.json",)),
    "sub/lmc:x.npz": SkillSource("", ("sub/lmc:x.npz",)),
    "lmc:a.npz,b.npz": SkillSource("lmc", ("a.npz", "b.npz")),
    "lmc:a,b.npz": SkillSource("lmc", ("a,b.npz",)),
    "lmc:a,b.npz,a.npz,mode=x": SkillSource("lmc", ("a,b.npz", "a.npz"), ("mode=x",)),
    "lmc:speed=2.npz,speed=3": SkillSource("lmc", ("speed=2.npz",), ("speed=3",)),
    "lmc:x,y.npz": SkillSource("lmc", ("x,y.npz",)),  # although there is a file "x" as well
    "lmc:x,b.npz": SkillSource("lmc", ("x", "b.npz")),
    "lmc:sub/t=1.npz": SkillSource("lmc", ("sub/t=1.npz",)),
    "lmc:t:1.npz": SkillSource("lmc", ("t:1.npz",)),
    "lmc:D:\\demos\\a.npz": SkillSource("lmc", ("D:\\demos\\a.npz",)),
    "lmc:my demo.npz,b.npz": SkillSource("lmc", ("my demo.npz", "b.npz")),
    "lmc: a.npz": SkillSource("lmc", (" a.npz",)),
    "lmc:mode=x,a.npz,,b.npz,": SkillSource("lmc", ("a.npz", "b.npz"), ("mode=x",)),
}
FILES = {file for source in AWKWARD.values() for file in source.files}


@pytest.fixture
def awkward(tmp_path):
    (tmp_path / "sub").mkdir()
    for file in FILES:
        (tmp_path / file).write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize("text", AWKWARD)
def test_files_are_told_apart_whatever_their_names_hold(text, awkward):
    assert parse_source(text, awkward) == AWKWARD[text]


@pytest.mark.parametrize("text", AWKWARD)
def test_what_is_taken_apart_and_written_again_is_the_same(text, awkward):
    assert parse_source(parse_source(text, awkward).text, awkward) == AWKWARD[text]


@pytest.mark.parametrize(
    ("text", "kind", "files"),
    [
        ("gone.skill.json", "", ("gone.skill.json",)),
        ("C:\\gone.skill.json", "", ("C:\\gone.skill.json",)),
        ("results/v1:gone.skill.json", "", ("results/v1:gone.skill.json",)),
        (":gone.npz", "", (":gone.npz",)),
        ("", "", ("",)),
        ("lmc:gone.npz,also gone.npz", "lmc", ("gone.npz", "also gone.npz")),
        ("lmc:/data/t=1.npz", "lmc", ("/data/t=1.npz",)),
        ("lmc:a\0b.npz", "lmc", ("a\0b.npz",)),
        ("lmc:" + ",".join(f"{i:03d}.npz" for i in range(60)), "lmc", tuple(f"{i:03d}.npz" for i in range(60))),
    ],
)
def test_files_that_do_not_exist_are_told_apart_by_the_form_of_the_text(text, kind, files, tmp_path):
    assert parse_source(text, tmp_path) == SkillSource(kind, files)


@pytest.mark.parametrize("text", ["lmc:", "lmc:,", "lmc:mode=absolute"])
def test_a_kind_without_a_demonstration_says_what_to_write(text):
    with pytest.raises(InputError, match=r"names no demonstration; write for example lmc:demo.npz"):
        parse_source(text)


@pytest.mark.needs_plugins
def test_a_demonstration_with_comma_colon_and_equals_sign_is_learned_from(folder):
    (folder / "demo1.npz").rename(folder / "x=1, t:2.npz")
    _, document = load_skill("replay:x=1, t:2.npz,mode=absolute", folder)
    assert document["learned_from"][0]["file"] == str(folder / "x=1, t:2.npz")
    assert document["phases"][0]["mode"] == "absolute"
