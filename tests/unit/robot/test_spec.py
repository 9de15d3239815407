"""robot.toml: what is read, what is refused, and with which sentence."""

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


DRIVEN = '[[actuation]]\njoint = "j"\nfmu = "x"\n'


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
        ("[control]\nrate_hz = 0", "positive"),
        (f"{DRIVEN}[sensors]\nencoder = -1e-4", r"sensors\.encoder: is -0\.0001; give 0 to 0\.1 rad"),
        (f"{DRIVEN}[sensors]\ncorner_hz = 0.0", r"sensors\.corner_hz: is 0; give 5 Hz or more"),
        (f"{DRIVEN}[sensors]\nencoder = 4096.0", r"sensors\.encoder: is 4096; give 0 to 0\.1 rad"),
        (f"{DRIVEN}[sensors]\npressure = 190e5", r"sensors\.pressure: is 1\.9e\+07; give 0 to 1e\+07 Pa"),
        (f"{DRIVEN}[gains]\nforce_corner_hz = 1.0", r"gains\.force_corner_hz: is 1; give 5 Hz or more"),
        (f"{DRIVEN}[sensors]\nnoise = 1.0", "noise"),
        (f"{DRIVEN}[gains]\nbody = -5.0", r"gains\.body: is -5; give 0 N s/m or more"),
        (f"{DRIVEN}[gains]\nbody = nan", r"gains\.body: is not a number"),
        (f"{DRIVEN}velocity_gain = -1.0", r"actuation of j: velocity_gain: is -1; give a positive"),
        ("[sensors]\nencoder = 1e-5", r"there is no \[\[actuation\]\]; leave them out"),
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
