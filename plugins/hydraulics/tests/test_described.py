"""Machines described by pins and data sheets: `[[cylinder]]`, `[[motor]]`, `[[loop]] pin` and `[defaults]`."""

import dataclasses
import math
import re

import numpy as np
import pytest
from skillframe_hydraulics.faults import moved_joints
from skillframe_hydraulics.law.symbolic_chain import closing_function
from skillframe_hydraulics.law.vdc_actuator import cylinders
from skillframe_hydraulics.watch import valve_speeds

from skillframe.errors import SkillframeError
from skillframe.extend.drives import audit
from skillframe.files import checkout
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests import digger, excavator

EXAMPLE = checkout() / "docs" / "how-to" / "excavator"
LOW, HIGH = np.array([-3.0, -0.9, 0.8, 0.2]), np.array([3.0, -0.05, 2.0, 1.5])


@pytest.fixture(scope="module")
def chain():
    return ClosedChain(load_model(load_robot(EXAMPLE)))


@pytest.fixture
def changed(tmp_path):
    """Writes the example with lines of robot.toml changed."""

    def write(*changes, urdf=()):
        for name, pairs in (("robot.toml", changes), ("excavator.urdf", urdf)):
            text = (EXAMPLE / name).read_text()
            for old, new in pairs:
                assert text.count(old) == 1, (old, text.count(old))
                text = text.replace(old, new)
            (tmp_path / name).write_text(text)
        return tmp_path

    return write


def test_an_excavator_takes_fewer_than_eighty_lines_and_check_finds_nothing(chain):
    assert len((EXAMPLE / "robot.toml").read_text().splitlines()) < 80
    assert not [each for each in audit(chain.robot.spec).problems if each.severity != "info"]
    assert chain.independent == ("slew", "boom", "stick", "bucket")


def test_it_is_the_machine_whose_urdf_draws_every_barrel_and_rod(chain, tmp_path):
    """Rods' places and moment arms, to rounding."""
    drawn = ClosedChain(load_model(load_robot(excavator.write_excavator(tmp_path))))
    names = {"stick_cylinder": "stick", "bucket_cylinder": "bucket"}
    order = [f"{names.get(name, name)}_rod" for name in excavator.CYLINDERS]
    rows = [chain.actuated.index(name) for name in ("slew", *order)]
    rng = np.random.default_rng(2)
    for z in rng.uniform(LOW, HIGH, (20, 4)):
        own, other = chain.at(z, np.zeros(4)), drawn.at(z, np.zeros(4))
        np.testing.assert_allclose(own.driven_motion[0][rows], other.driven_motion[0], atol=1e-10)
        np.testing.assert_allclose(own.arms[rows], other.arms, atol=1e-9)
        assert np.abs(chain.gaps(own.q)).max() < 1e-10


def test_cylinders_of_a_digger_whose_hinges_turn_the_other_way_are_those_drawn(tmp_path):
    described, drawn = tmp_path / "described", digger.write_digger(tmp_path / "drawn")
    described.mkdir()
    parts = "".join(digger._part(name, part) for name, part in digger.PARTS.items())
    tool = digger._fixed("tool_mount", "bucket", "tool", (0.4, 0.0))
    (described / "digger.urdf").write_text(f'<robot name="digger"><link name="base_link"/>{parts}{tool}</robot>')
    text = (drawn / "robot.toml").read_text()
    text = text[: text.index("[[loop]]")]
    text = "".join(line for line in text.splitlines(True) if not re.match(r"\w+_(barrel_pivot|piston) =", line))
    for name, jack in digger.JACKS.items():
        pins = [f'["{link}", [{at[0]}, 0.0, {at[1]}]]' for link, at in (
            (digger.PARTS[name].parent, jack.pivot), (name, jack.eye))]  # fmt: skip
        text += f'[[cylinder]]\nname = "{name}"\nfrom = {pins[0]}\nto = {pins[1]}\nclosed = {jack.closed}\n'
        figures = f"{digger.FIGURES[name]}, {digger.COMMON}".replace(", ", "\n")
        text += f"stroke = {jack.stroke}\nmass = {jack.barrel + jack.rod}\n{figures}\n"
    (described / "robot.toml").write_text(text)
    one, two = (ClosedChain(load_model(load_robot(folder))) for folder in (described, drawn))
    assert one.actuated == ("boom_rod", "stick_rod", "bucket_rod")
    for turn in (-0.1, 0.0, 0.1):
        z = two.minimal(two.home) + turn
        own, other = one.at(z, np.zeros(3)), two.at(z, np.zeros(3))
        np.testing.assert_allclose(own.driven_motion[0], other.driven_motion[0], atol=1e-10)
        np.testing.assert_allclose(own.arms, other.arms, atol=1e-9)
    assert sum(i.mass for i in one.model.inertias) == pytest.approx(sum(i.mass for i in two.model.inertias), abs=1e-9)


def test_transmission_and_mass_matrix_are_those_of_differences_and_of_energy(chain):
    """Pinocchio's mass matrix is wrong without a word if joints do not come depth first; its kinetic energy is not."""
    rng, h = np.random.default_rng(7), 1e-6
    for z in rng.uniform(LOW, HIGH, (5, 4)):
        zd = rng.uniform(-1.0, 1.0, 4)
        state = chain.at(z, zd)
        moved = [chain.configuration(z + s) - chain.configuration(z - s) for s in h * np.eye(4)]
        np.testing.assert_allclose(state.embedding, np.array(moved).T / (2.0 * h), atol=1e-8)
        assert 0.5 * zd @ state.mass @ zd == pytest.approx(state.energy()[0], rel=1e-12)
        q, gap = closing_function(chain)(z, chain.configuration(z + 1e-3))
        assert float(gap) < 1e-11
        np.testing.assert_allclose(np.array(q).ravel(), state.q, atol=1e-11)


def test_units_change_nothing_but_the_text(chain, changed):
    folder = changed(
        ('slew = "17 deg"', f"slew = {math.radians(17.0)!r}"), ('"350 bar"', "350e5"), ('"4 l"', "4e-3"),
        ('"120 l/min"', "2e-3"), ('bore = "160 mm"', "bore = 0.16"), ("closed = 2.0\n", 'closed = "2000 mm"\n'),
        ('["house", [0.75, 0.0, 1.35]]', '["house", ["75 cm", 0.0, "1350 mm"]]'), ("mass = 260", 'mass = "0.26 t"'),
        ('displacement = "180 cm3"', "displacement = 180e-6"), ('coulomb_friction = "8 kNm"', "coulomb_friction = 8e3"),
    )  # fmt: skip
    own, other = load_robot(folder), chain.robot.spec
    for one, two in zip(own.actuation, other.actuation, strict=True):
        assert one.parameters == pytest.approx(two.parameters, rel=1e-12)
    assert own.home == pytest.approx(other.home)
    model = load_model(own).model
    np.testing.assert_allclose(model.jointPlacements[7].homogeneous, chain.model.jointPlacements[7].homogeneous)
    assert [i.mass for i in model.inertias] == pytest.approx([i.mass for i in chain.model.inertias])


def test_figures_of_defaults_are_those_of_every_cylinder_and_a_motors_displacement_is_of_a_revolution(chain):
    spec = {each.joint: each.parameters for each in chain.robot.spec.actuation}
    assert spec["slew"]["displacement"] == pytest.approx(180e-6 * 270.0 / (2.0 * math.pi), rel=1e-12)
    assert not {"bore", "rod", "stroke", "closed", "mass"} & spec["slew"].keys()
    assert spec["slew"]["rated_flow"] == pytest.approx(5e-3) and spec["slew"]["coulomb_friction"] == 8e3
    for name in ("boom_left_rod", "boom_right_rod", "stick_rod", "bucket_rod"):
        assert spec[name]["dead_volume_a"] == spec[name]["dead_volume_b"] == 4e-3
        assert spec[name]["rated_flow"] == pytest.approx(2e-3)
    assert spec["boom_left_rod"]["stroke"] == 1.6


def test_a_cylinder_on_a_joint_and_one_of_another_maker(changed):
    own = 'joint = "boom"\nfmu = "theirs.fmu"\nparameters = { d = 0.1 }\ninputs = { command = "u" }\n'
    folder = changed(
        ('name = "boom"\ncount = 2                   # beside each other, an offset to each side [m]\n', own),
        ('offset = 0.45\nfrom = ["house", [0.75, 0.0, 1.35]]\nto = ["boom", [2.9, 0.0, 0.55]]\nclosed = 2.0\n', ""),
        ("mass = 260\n", ""),
    )
    spec = load_robot(folder)
    boom = spec.actuation[0]
    assert (boom.joint, boom.fmu, boom.parameters, boom.inputs) == ("boom", "theirs.fmu", {"d": 0.1}, {"command": "u"})
    assert boom.nominal["bore"] == 0.16 and boom.nominal["supply_pressure"] == 350e5
    assert [strut.name for strut in spec.strut] == ["stick", "bucket"]


PINS = 'pin = [["bucket", [0.12, 0.0, 0.48]], ["link", [0.62, 0.0, 0.0]]]'
BRANCH = 'rocker = "-52 deg", link = "80 deg"'
REFUSED = [
    (("closed = 2.0\n", "closed = 1.0\n"), "boom_left.stroke: is 1.6 m, and no such rod fits into 1 m when closed"),
    (('displacement = "180 cm3"\n', ""), "motor on slew: has no displacement"),
    (('displacement = "180 cm3"', 'displacement = "180 bar"'), "slew.displacement: expected a quantity in m3"),
    (("closed = 3.0\n", ""), "cylinder stick: has no closed"),
    (("offset = 0.45\n", ""), "cylinder boom.offset: belongs to count = 2"),
    (('from = ["house"', 'from = ["hous"'), "unknown link 'hous'; did you mean 'house'"),
    (("1.25]]", "]]"), "cylinder stick.from: is ['boom', [2.9, 0.0]]; write from = [\"link\", [x, y, z]]"),
    (('to = ["rocker"', 'to = ["stick"'), "bucket: its pins lie on stick and stick, which do not turn"),
    (('rod = "120 mm"', 'rod = "120 deg"'), "parameters.rod: expected a quantity in m, got 120 deg"),
    (("[defaults.cylinder]", "[defaults.cylinders]"), "unknown key 'cylinders'; did you mean 'cylinder'"),
    (("[[motor]]", "[motor]"), "motor: is no list of tables; write [[motor]]"),
    (('name = "stick"\nfrom', 'name = "bucket"\nfrom'), "two drive one joint"),
    ((PINS, f'{PINS}\nframe_a = "bucket"\nframe_b = "link"'), "loop 1: has pin and frames"),
    ((PINS, ""), "loop 1: lacks frame_a, frame_b, or pin in their place"),
    (('bucket = "52 deg"', 'bucket = "52 deg"\nrocker = 1.0'), "loop 1.branch: rocker stands under [home]"),
    ((BRANCH, 'rocker = "120 deg", link = "80 deg"'), "the loops do not close on the branch that is written"),
    (("[0.62, 0.0, 0.0]", "[0.22, 0.0, 0.0]"), "open by 402 mm at (8039, 2458, 1994) mm in base, cannot be closed"),
    (('to = ["stick", [-0.75, 0.0', 'to = ["stick", [-0.75, 0.2'), "stick_eye - stick_rod_eye is open by 200 mm"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), REFUSED, ids=[said[:40] for _, said in REFUSED])
def test_a_wrong_description_is_refused_in_a_sentence(changed, change, said):
    with pytest.raises(SkillframeError, match=re.escape(said)):
        ClosedChain(load_model(load_robot(changed(change))))


CHECKED = [
    (('bore = "160 mm"', 'bore = "100 mm"'), "the cylinder on boom_left_rod has rod 0.11, not below its bore 0.1"),
    (('[payload]\nlink = "bucket"\nmass = "1500 kg"\nrating = "1500 kg"\n', ""), "the machine declares no payload"),
    (('"120 l/min"', "120"), "rated_flow of the cylinder on boom_left_rod is 120 m3/s"),
    (("mass = 220", "mass = 220\nbroe = 3"), "unknown figure 'broe'; did you mean 'bore'"),
    (("closed = 2.0\n", "closed = 2.95\n"), "the pins of boom_left would be 2.942 m apart, and it is 2.95 to 4.55 m"),
    (("stroke = 1.25", "stroke = 0.2"), "the pins of bucket would be 2.805 m apart, and it is 2.05 to 2.25 m long"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "said"), CHECKED, ids=[said[:40] for _, said in CHECKED])
def test_check_holds_figures_against_each_other(changed, change, said):
    found = [each.message for each in audit(load_robot(changed(change))).problems if each.severity != "info"]
    assert any(said in message for message in found), found


def test_a_cylinder_too_short_for_the_drawn_range_of_its_joint_is_doubted(changed):
    """By the cosine rule: pins 3.716 m and 0.875 m from the joint are 3 to 3.8 m apart at 0.54 to 1.55 rad."""
    drawn = '<origin xyz="6.4 0.0 0.0"/><axis xyz="0 1 0"/><limit lower="%s" upper="%s"'
    stroke = ('stroke = 1.6\nbore = "170', 'stroke = 0.8\nbore = "170')
    folder = changed(stroke, urdf=[(drawn % (-np.pi, np.pi), drawn % (0.3, 2.6))])
    found = [each.message for each in audit(load_robot(folder)).problems if each.code == "short_reach"]
    assert found[0].startswith("stick allows 44 % of the range of stick: over it")


def test_a_hinge_out_of_the_plane_and_a_name_that_is_taken_are_named(changed):
    joint = '<parent link="stick"/><child link="rocker"/><origin xyz="2.75 0.0 0.05"'
    folder = changed(('from = ["stick", [0.35', 'from = ["boom", [0.35'), urdf=[(joint, f'{joint} rpy="0.1 0 0"')])
    with pytest.raises(SkillframeError, match="joints between boom and rocker do not turn about parallel axes"):
        load_model(load_robot(folder))
    taken = '<link name="boom_left_barrel"/><joint name="t" type="fixed"><parent link="teeth"/>'
    taken = f'<link name="teeth"/>{taken}<child link="boom_left_barrel"/></joint>'
    with pytest.raises(SkillframeError, match="the URDF has a link 'boom_left_barrel' already"):
        load_model(load_robot(changed(urdf=[('<link name="teeth"/>', taken)])))


def test_a_slew_whose_urdf_gives_no_speed_is_as_fast_as_its_valve_lets_it(chain):
    """300 l/min at 20 bar are 5e-3 sqrt(395 / 20) m3/s at 400 bar of relief and 5 of the return line, over D."""
    known, moved = cylinders(chain.robot.spec.actuation), moved_joints(chain)
    assert math.isinf(chain.minimal(chain.model.velocityLimit)[0])
    speeds = valve_speeds(chain, known, moved)
    assert speeds[0] == pytest.approx(5e-3 * math.sqrt(395.0 / 20.0) / (180e-6 * 270.0 / (2.0 * math.pi)), rel=1e-9)
    assert 2.0 < speeds[0] < 4.0 and np.all(speeds[1:] > 3.0)  # a boom whose arm may fall to 0.1 m is not slower


def test_a_strut_says_what_it_is_without_a_plugin(chain):
    """The core's own table; `[[cylinder]]` writes it."""
    left = next(strut for strut in chain.robot.spec.strut if strut.name == "boom_left")
    assert dataclasses.asdict(left) == {
        "name": "boom_left", "base": ("house", (0.75, 0.0, 1.35)), "eye": ("boom", (2.9, 0.0, 0.55)), "closed": 2.0,
        "stroke": 1.6, "mass": 260.0, "beside": 0.45,
    }  # fmt: skip
