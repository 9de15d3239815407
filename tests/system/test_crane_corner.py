"""The crane in the world of pallets, through the command line: pushed into the corner, drawn, replayed."""

import json

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.execution.trace import Trace
from tests.crane_corner import PEAK, SKILL, into_the_corner

pytestmark = [pytest.mark.slow, pytest.mark.needs_plugins]


def test_one_run_ends_within_10_mm_of_the_corner_and_its_page_shows_the_machine(tmp_path, capsys):
    trace, page = tmp_path / "run.npz", tmp_path / "run.html"
    command = ["run", str(SKILL), "--world", "pallets", "--robot", "hiab_xs031", "--out", str(trace)]
    assert run([*command, "--replay", str(page), "--json"]) == 0
    outcome = json.loads(capsys.readouterr().out)
    assert outcome["success"] and outcome["final_error_m"] < 0.01
    assert "came to rest while pushing" in outcome["reason"]
    read = Trace.load(trace)
    drawn = {body["name"]: len(body["geoms"]) for body in read.meta["bodies"]}
    assert drawn["sprung_stack"] > 1 and drawn["sprung_stop"] > 0
    held = np.linalg.norm(read.wrench_true[-1, :3])
    assert 1500.0 < held < PEAK  # the push, and what the desired speed adds to it
    assert "extension" in page.read_text(encoding="utf-8")


def test_from_each_start_the_corner_is_reached_through_styrofoam_too():
    corner = into_the_corner("styrofoam", 3, seed=7)
    assert corner.good.all(), (corner.result.failure, corner.result.peak_force_n)


@pytest.mark.figures
def test_a_trial_in_contact_is_the_same_to_the_last_bit_alone_and_beside_another():
    skill = json.loads(SKILL.read_text(encoding="utf-8"))
    drawn = {
        "start.offset_z": np.array([-0.32, -0.30]), "actuator.friction_scale": np.array([0.9, 1.1]),
        "actuator.deadband": np.array([0.004, 0.0]), "actuator.delay": np.array([0.0, 3e-3]),
    }  # fmt: skip

    def traces(ids):
        runnable, setup = prepare(load_robot_model("hiab_xs031"), load_world("pallets", {}), skill)
        rngs, mine = [np.random.default_rng([3, i]) for i in ids], {name: v[ids] for name, v in drawn.items()}
        return simulate(runnable, setup, mine, rngs, duration_s=1.5, trace_hz=100.0).traces

    together = traces([0, 1])
    for i in range(2):
        (alone,) = traces([i])
        assert np.abs(alone.wrench_true[:, 2]).max() > 1000.0
        for name in ("position", "wrench", "wrench_true", "q", "body_position"):
            assert np.array_equal(getattr(alone, name), getattr(together[i], name)), name
