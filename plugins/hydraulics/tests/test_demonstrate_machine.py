from dataclasses import replace
from math import radians

import numpy as np
import pytest
from skillframe_hydraulics.sessions import aimed, demonstration_of_machine, operate, record_operated
from skillframe_hydraulics.teleoperation import OperatorSettings
from skillframe_recordings.audit import audit

from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.execution.trace import Trace
from skillframe.extend.reading import read_demonstration, write_demonstration

SAMPLES = 200


@pytest.fixture(scope="module")
def crane():
    return load_robot_model("hiab_xs031")


def trace_of_a_slide(rng):
    """What the machine's loop leaves behind, with estimates that differ from the truth."""
    time = np.arange(SAMPLES) / 100.0
    place = np.zeros((SAMPLES, 3))
    place[:, 0] = 3.0 + 0.1 * time
    estimated, true = np.zeros((SAMPLES, 6)), np.zeros((SAMPLES, 6))
    estimated[:, [0, 2]], true[:, [0, 2]] = 1e3 * rng.standard_normal((SAMPLES, 2)), [-1500.0, 5000.0]
    attitude = np.tile([0.0, 0.0, 0.0, 1.0], (SAMPLES, 1))
    meta = {"robot": "hiab_xs031", "center_of_compliance": [0.0, 0.0, 0.0], "events": []}
    none = np.zeros((SAMPLES, 6))
    return Trace(
        time=time, position=place, quaternion=attitude, twist=none, wrench=estimated, wrench_true=true,
        desired_position=place, desired_quaternion=attitude, command_wrench=none, q=np.zeros((SAMPLES, 7)),
        body_position=np.zeros((SAMPLES, 1, 3)), body_quaternion=np.tile(attitude[:, None], (1, 1, 1)),
        machine={"force_sigma": rng.uniform(60.0, 400.0, (SAMPLES, 2)), "force_valid": np.ones(SAMPLES)}, meta=meta,
    )  # fmt: skip


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_a_demonstration_is_what_the_machine_knew_and_no_truth_and_reads_back_the_same(ending, tmp_path):
    trace, scene = trace_of_a_slide(np.random.default_rng(0)), load_world("pallets", {})
    kept = demonstration_of_machine(trace, scene, OperatorSettings(delay_s=0.15), seed=4, slot=1)
    write_demonstration(kept, tmp_path / f"push.{ending}")
    read = read_demonstration(tmp_path / f"push.{ending}")
    np.testing.assert_array_equal(read.wrench[:, :3], trace.wrench[:, :3])
    np.testing.assert_array_equal(read.position, trace.position)
    np.testing.assert_array_equal(read.extra["sigma_2"], trace.machine["force_sigma"][:, 1])
    assert read.meta["wrench"]["sign"] == "environment" and not read.meta["wrench"]["includes_tool_weight"]
    assert read.meta["teacher"] == "teleoperation"
    assert (read.meta["simulated"]["delay_s"], read.meta["simulated"]["seed"]) == (0.15, 4)
    assert "sensor" not in read.meta  # there is none
    assert not [text for text in audit(read).warnings if "is exactly" in text]  # a plane knows no force across it


@pytest.mark.parametrize("degrees", [-90.0, -45.0, -20.0, 0.0])
def test_an_angle_is_counted_from_the_cranes_forward_axis_in_its_plane(crane, degrees):
    direction = np.array(aimed(crane, load_world("pallets", {}), radians(degrees)).task.direction)
    np.testing.assert_allclose(direction, [np.cos(radians(degrees)), 0.0, np.sin(radians(degrees))], atol=1e-15)


def test_an_unstable_channel_is_refused_before_a_machine_is_built(crane, monkeypatch):
    monkeypatch.setattr("skillframe_hydraulics.sessions.simulate", lambda *args, **more: pytest.fail("it moved"))
    with pytest.raises(InputError, match="loop gain"):
        record_operated(crane, load_world("pallets", {}), OperatorSettings(feed_velocity=True), count=1, seed=0)


def test_a_world_that_gives_an_operator_nowhere_to_push_is_refused(crane):
    scene = load_world("pallets", {})
    idle = replace(scene, task=replace(scene.task, direction=None))
    with pytest.raises(InputError, match="nowhere to push"):
        operate(crane, idle, OperatorSettings(), {}, [np.random.default_rng(0)])
