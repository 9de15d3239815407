"""A machine that rings is told by its tool's speed; a sound, a late and a stuck one are not."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from skillframe_hydraulics.force.calibration import SWING_S, Ringing, swing, what_to_set
from skillframe_hydraulics.law.gains import law_gains

from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.digger import write_digger
from tests.digger_landing import press
from tests.fmu_cache import own_cache  # noqa: F401

DT, END = 1e-3, SWING_S
HARD = dict.fromkeys(("boom", "stick", "bucket"), "velocity_gain = 5e-3\nforce_gain = 4e-9")


def swung(*tools, until=END):
    """After a swing of tools whose velocities are told by time and path."""
    seen = Ringing(len(tools), DT, END)
    for tick in range(round(until / DT)):
        _, velocity, _, _ = swing(tick * DT)
        seen.step(np.array([tool(tick * DT, velocity) for tool in tools]), velocity)
    return seen


def law(robot):
    chain = ClosedChain(load_model(load_robot(str(robot))))
    return SimpleNamespace(chain=chain, gains=law_gains(chain))


@pytest.fixture(scope="module")
def hard(tmp_path_factory):
    """A digger with the gains of the crane that ships."""
    return write_digger(tmp_path_factory.mktemp("hard"), "[gains]\nbody = 1000.0", extra=HARD)


def test_speeds_are_those_of_what_was_shown():
    seen = swung(lambda t, v: v + np.array([0.3 * np.sin(2 * np.pi * 7.0 * t), 0.0]))
    assert seen.beside[0] == pytest.approx(0.3 / np.sqrt(2.0), rel=1e-3)  # whole periods, 49
    assert seen.after[0] == pytest.approx(0.3 / np.sqrt(2.0), rel=0.02)  # three and a half
    assert "7.0 times a second" in seen.sentences(law("hiab_xs031"))[0]


def test_a_machine_that_fails_before_it_was_commanded_to_rest_is_not_said_to_move_at_rest():
    (text,) = swung(lambda t, v: v + 1.0, until=1.0).sentences(law("hiab_xs031"))
    assert "beside a path of" in text and "lacks the pressure to carry its load" in text and "at rest" not in text


def test_a_machine_that_follows_late_or_badly_or_not_at_all_does_not_ring():
    late = [swing((k - 100) * DT)[1] for k in range(round(END / DT) + 1)]
    seen = swung(
        lambda t, v: v, lambda t, v: 0.0 * v, lambda t, v: 0.5 * v, lambda t, v: late[round(t / DT)],
        lambda t, v: v + 0.04 * np.sin(50.0 * t),  # as much as a sound crane's tool moves with valves 40 ms late
    )  # fmt: skip
    assert seen.sentences(law("hiab_xs031")) == [""] * 5


def test_what_to_set_is_what_follows_from_the_machines_figures(hard, tmp_path):
    text = what_to_set(law(hard))
    derived = law(write_digger(tmp_path))
    assert f"gains.body from 1e+03 to {derived.gains.body:.3g}" in text
    assert f"velocity_gain of boom_piston from 0.005 to {derived.gains.velocity[0]:.3g}" in text
    assert "force_gain" not in text  # it is as derived
    assert "follow from its figures already" in what_to_set(derived)


@pytest.mark.slow
def test_a_digger_with_the_cranes_gains_is_stopped_before_it_touches_and_with_its_own_it_lands(hard, tmp_path):
    said = press(hard, 2, 5).reason
    for text in said:
        after = int(re.search(r"still moves at (\d+) mm/s", text)[1])
        often = float(re.search(r"([\d.]+) times a second", text)[1])
        assert text.startswith("the machine rings: ") and after > 200
        assert 6.0 < often < 9.0  # the linear model's least damped pole has 7.6 Hz
    assert all(press(write_digger(tmp_path), 2, 5).success)
