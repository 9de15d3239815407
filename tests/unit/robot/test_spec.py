"""robot.toml: what is read, what is refused, and with which sentence."""

import math
import subprocess
import sys

import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.robot.spec import load_robot, robot_names


def test_shipped_robots_are_found_by_name():
    assert {"free_tool", "panda"} <= set(robot_names())
    panda = load_robot("panda")
    assert (panda.name, panda.base, panda.arm[0].tool_frame) == ("panda", "fixed", "flange")
    assert load_robot(panda.folder) == load_robot(panda.folder / "robot.toml") == panda


def test_a_name_with_a_typo_gets_a_suggestion():
    with pytest.raises(UnknownName, match="did you mean 'panda'"):
        load_robot("pnada")


def test_a_users_own_robots_come_before_the_shipped_ones(save, urdf, tmp_path, monkeypatch):
    toml = save(urdf.tree(0, 2), "", name="panda")
    (tmp_path / "robots").mkdir()
    toml.parent.rename(tmp_path / "robots" / "panda")
    monkeypatch.setenv("SKILLFRAME_PATH", str(tmp_path))
    assert load_robot("panda").folder == tmp_path / "robots" / "panda"


def test_a_bare_urdf_is_a_robot_on_a_fixed_base_without_arms(save, urdf):
    spec = load_robot(save(urdf.tree(0, 2)))
    assert (spec.base, spec.arm, spec.mimic) == ("fixed", (), True)
    with pytest.raises(InputError, match=r"a URDF alone names no arm to run; write a robot\.toml beside it"):
        spec.require_simulated()


def test_a_bare_urdf_that_cannot_run_names_the_robot_toml_beside_it(save, urdf):
    toml = save(urdf.tree(0, 2), '[[arm]]\nname = "arm"\ntool_frame = "a"')
    with pytest.raises(InputError, match=f"a URDF alone names no arm to run; give {toml}"):
        load_robot(toml.with_name("made.urdf")).require_simulated()


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ('bsae = "free"', "did you mean 'base'"),
        ('base = "floating"', "unknown value 'floating'"),
        ("[limits]\nforce_n = -3.0", "positive"),
        ("[limits]\nworkspace_m = [[0, 0, 0], [1, 1, 0]]", "lower corner first"),
        ("[home]\nj = inf", "finite"),
        ("[[arm]]\nname = 'a'\ntool_frame = 'x'\n[[arm]]\nname = 'a'\ntool_frame = 'y'", "two arms"),
        ("[inertia]\nl0 = { mass = 1.0 }", "missing inertia"),
        ("mimic = 1", "expected true or false"),
        ("[sensors]\nencoder = 1e-5", "unknown key 'sensors'"),
        ("[control]\nrate_hz = 0", "control.rate_hz: 0 Hz is beyond 1Hz to 100000Hz; give 1Hz to"),
    ],
)
def test_a_robot_toml_that_says_something_impossible_is_refused_with_its_key(save, urdf, toml, sentence):
    with pytest.raises(InputError, match=sentence):
        load_robot(save(urdf.tree(0, 2), toml))


def test_a_missing_urdf_and_a_missing_file_are_named(save, urdf, tmp_path):
    toml = save(urdf.tree(0, 2), "")
    toml.with_name("made.urdf").unlink()
    with pytest.raises(InputError, match=r"made\.urdf"):
        load_robot(toml)
    with pytest.raises(InputError, match="no such file"):
        load_robot(tmp_path / "nowhere" / "robot.urdf")


@pytest.mark.parametrize(
    ("entry", "problem"),
    [
        ('[[loop]]\nframe_a = "a"\nframe_b = "b"', r"\[\[loop\]\] and no \[\[actuation\]\]; say which joints"),
        ('[[actuation]]\njoint = "j"\nfmu = "x"\nparameters = { bore = 0.08 }', "names no arm; add"),
    ],
)
def test_loops_nobody_drives_and_a_machine_without_an_arm_are_refused_when_a_plant_is_asked_for(
    save, urdf, entry, problem
):
    spec = load_robot(save(urdf.tree(0, 2), entry))
    assert len(spec.loop) + len(spec.actuation) == 1
    with pytest.raises(InputError, match=problem):
        spec.require_simulated()


def test_reading_a_spec_loads_no_robot_library():
    code = "import sys; from skillframe.robot import load_robot; load_robot('panda'); print('pinocchio' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


SLIDE = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def slider(tmp_path, toml):
    (tmp_path / "slide.urdf").write_text(SLIDE)
    (tmp_path / "robot.toml").write_text(f'urdf = "slide.urdf"\n{toml}')
    return tmp_path / "robot.toml"


def test_numbers_of_robot_toml_take_units_and_those_of_home_are_their_joint_s(tmp_path):
    spec = load_robot(slider(tmp_path, """
home = { turn = "90deg", slide = "30mm" }
limits = { force_n = "0.2kN", workspace_m = [["-50cm", 0, 0], [1, 1, "900mm"]] }
workspace = { fixture = ["50cm", 0, 0.2] }
control = { rate_hz = "1kHz" }"""))  # fmt: skip
    assert spec.home == {"turn": math.pi / 2.0, "slide": 0.03}
    assert spec.limits.force_n == 200.0
    assert spec.limits.workspace_m == ((-0.5, 0.0, 0.0), (1.0, 1.0, 0.9))
    assert (spec.workspace.fixture, spec.control.rate_hz) == ((0.5, 0.0, 0.2), 1000.0)


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ('home.turn = "30mm"', r"home\.turn: expected a quantity in rad, got 30mm"),
        ('home.slide = "30deg"', r"home\.slide: expected a quantity in m, got 30deg"),
        ('limits.force_n = "80mm"', r"limits\.force_n: expected a quantity in N, got 80mm"),
        ("workspace.fixture = [500, 0, 200]", r"fixture\[0\]: 500 m is beyond -100m to 100m; did you mean 500mm\?"),
        ('control.rate_hz = "1MHz"', r"control\.rate_hz: expected a quantity in Hz, got 1MHz, and 'MHz' is no unit"),
    ],
)
def test_a_unit_that_is_not_the_quantity_s_and_a_place_that_no_machine_reaches_are_refused(tmp_path, toml, sentence):
    with pytest.raises(InputError, match=sentence):
        load_robot(slider(tmp_path, toml))
