"""Every export against what the controllers declare, pinned in declarations.toml with repository and commit."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml

from skillframe.document.export import exported, moving_impedance
from skillframe.document.frame import frame_at
from skillframe.errors import InputError
from skillframe.extend.builtin import skillframe_exporters

PINNED = tomllib.loads((Path(__file__).parent / "declarations.toml").read_text(encoding="utf-8"))
FORMATS = {each.name: each for each in skillframe_exporters()}
STOP = {"lead_force_n": 20.0, "lead_torque_nm": 2.0, "time_limit_s": 20.0}
WHAT = {"bool": bool, "double": float, "float64": float, "string": str, "uint8": int, "int32": int, "uint32": int}


def phase(stiffness=1000.0, damped=0.1):
    def part(k, direction, speed):
        k = np.asarray(k, dtype=float)
        damping = (damped * k).tolist()
        return {"stiffness": k.tolist(), "damping": damping, "speed": speed, "desired_direction": direction}

    body = {
        "translation": part(np.diag([0.0, stiffness, stiffness]), [0.0, 0.0, -1.0], 0.02),
        "rotation": part(np.diag([20.0, 0.0, 20.0]), [0.0, 1.0, 0.0], 0.05), "stop": STOP,
    }  # fmt: skip
    frame = frame_at([0.0, 0.0, 0.2], axes="base")
    return moving_impedance({"type": "lmc", "frame": frame, "phases": [body]}, None, "base", None, "peg")


def written(form, **changes):
    """What a receiver reads: (full name, value) of every leaf, below the node's name if there is one."""
    body = yaml.safe_load(exported(FORMATS[form], phase(**changes), []))
    if node := PINNED[form].get("node"):
        assert set(body) == {node}
        body = body[node]["ros__parameters"]
    return dict(leaves(body, ""))


def leaves(value, name):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{name}.{key}".lstrip("."))
    else:
        yield name, value


def is_of(value, declared):
    """Whether a value can be assigned to what is declared; ROS 2 takes no integer for a double."""
    kind, _, count = declared["type"].partition("[")
    values = value if count else [value]
    if count and (not isinstance(value, list) or len(value) != int(count.rstrip("]"))):
        return False
    low, high = declared.get("bounds", (-np.inf, np.inf))
    fits = all(type(v) is WHAT[kind] for v in values) and value in declared.get("one_of", [value])
    return fits and (kind in ("bool", "string") or all(low <= v <= high for v in values))


@pytest.mark.parametrize("form", FORMATS)
def test_every_name_and_type_of_an_export_is_one_that_its_controller_declares(form):
    declared = PINNED[form]["declared"]
    wrong = {name: value for name, value in written(form).items() if name not in declared}
    assert not wrong, f"{form} declares no {sorted(wrong)}"
    bad = {name: value for name, value in written(form).items() if not is_of(value, declared[name])}
    assert not bad, f"{form}: of another type, or out of bounds: {bad}"


def test_every_parameter_that_holds_the_skill_is_written():
    assert set(written("crisp")) == set(PINNED["crisp"]["declared"])
    assert set(written("cartesian_controllers")) == set(PINNED["cartesian_controllers"]["declared"])
    # what is not sent stays zero in a ROS 2 message: the stamp, and the pose, which velocity mode ignores
    unsent = {n for n in PINNED["aic_motion_update"]["declared"] if n.startswith(("header.stamp", "pose."))}
    assert set(written("aic_motion_update")) == set(PINNED["aic_motion_update"]["declared"]) - unsent


@pytest.mark.parametrize("form", FORMATS)
def test_the_file_says_which_repository_and_commit_it_was_checked_against(form):
    text = exported(FORMATS[form], phase(), [])
    said = [line for line in text.splitlines() if line.startswith("# checked against ")]
    assert len(said) == 1
    assert PINNED[form]["repository"] in said[0]
    assert f" {PINNED[form]['commit'][:7]} " in said[0]


def test_the_file_says_what_a_controller_s_older_or_own_settings_do_to_the_skill():
    assert f"needs crisp_controllers {PINNED['crisp']['needs']} or newer" in exported(FORMATS["crisp"], phase(), [])
    aic = exported(FORMATS["aic_motion_update"], phase(), [])
    assert "limits the wrench to 10 N and 10 Nm per axis (impedance.maximum_wrench)" in aic
    assert "the spring acts at end_effector_link" in exported(FORMATS["cartesian_controllers"], phase(), [])


def test_a_stiffness_that_crisp_would_refuse_to_load_is_refused_with_its_bound():
    low, high = PINNED["crisp"]["declared"]["task.k_pos_y"]["bounds"]
    assert written("crisp", stiffness=high)["task.k_pos_y"] == high > low
    with pytest.raises(InputError, match="5001, and crisp_controllers takes 5000 at most"):
        written("crisp", stiffness=high + 1.0)
    with pytest.raises(InputError, match="6000, and crisp_controllers takes 5000 at most"):
        written("crisp", damped=6.0)
