"""How accurate is the co-simulated crane? Three FMUs on the machine against one system solved by scipy's Radau.

The reference holds the mechanics (loop embedding) and the oil (numpy equations) in one state and steps as it likes. So
the differences hold everything: the coupling, MuJoCo's integrator and constraints, the FMUs' own integrator.
"""

import numpy as np
import pytest

from skillframe.fmu.build import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401
from tests.laws.crane_monolith import Monolith
from tests.laws.crane_plants import START, ChainPlant, History, coupled, crane, cylinders, simulated, tooled, waves

pytestmark = [pytest.mark.figures, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
HOLD = 0.01
STEPS = (1e-3, 5e-4, 2.5e-4)
COMMANDS = waves(150, HOLD, (0.2, -0.2, 0.3), (1.0, 1.0, 1.5))  # three cylinders through reversals, 1.5 s


class Surface:
    """A spring under the tool's tip: force up in base, \\(k\\,\\max(0, h - z)\\) [N], with damping while it presses."""

    def __init__(self, chain, height, stiffness, damping=0.0):
        self.chain, self.height, self.stiffness, self.damping = chain, height, stiffness, damping
        self.frame = chain.robot.tool_frames[0]

    def __call__(self, state):
        gap = self.height - state.data.oMf[self.frame].translation[2]
        if gap <= 0.0:
            return None
        row = state.jacobian(self.frame)[2]
        return row * max(0.0, self.stiffness * gap - self.damping * float(row @ state.zd))


def errors(history, reference):
    """Largest piston error [m] and pressure error [Pa]."""
    piston, pressure = reference
    return np.abs(history.piston - piston).max(), np.abs(history.pressure_a - pressure).max()


def orders(values):
    return np.log2(np.divide(values[:-1], values[1:]))


def report(title, steps, found, histories):
    for h, (piston, pressure), run in zip(steps, found, histories, strict=True):
        print(
            f"{title} {h * 1e3:g} ms: piston {piston * 1e6:.3f} um, pressure {pressure / 1e5:.1e} bar,"
            f" bond residual {run.residual.max():.1e}"
        )


def test_in_free_motion_the_coupling_is_of_second_order_and_within_five_micrometres_at_a_millisecond():
    machine = Monolith(START, cylinders(), chain=tooled())
    states = machine.held(COMMANDS, HOLD)
    reference = machine.pistons(states), states[:, 12:15]
    runs = [History(coupled(simulated(h), cylinders(), h, chain=tooled()), COMMANDS, HOLD) for h in STEPS]
    found = [errors(run, reference) for run in runs]
    report("free", STEPS, found, runs)
    assert found[0][0] < 5e-6
    assert all(run.residual.max() < 3e-4 and not run.trouble for run in runs)
    for k in range(2):
        assert ((orders([f[k] for f in found]) > 1.8) & (orders([f[k] for f in found]) < 2.2)).all()


def test_on_a_surface_of_a_million_newtons_per_metre_it_stays_within_five_micrometres():
    """From 2 mm above, pressed onto the surface and drawn along it."""
    chain = crane()
    height = chain.at(START, np.zeros(3)).data.oMf[chain.robot.tool_frames[0]].translation[2] - 2e-3
    surface = Surface(chain, height, 1e6)
    commands = np.zeros((150, 3))
    commands[:60, 0] = -0.05
    commands[60:, 2] = 0.1
    machine = Monolith(START, cylinders(), external=surface)
    states = machine.held(commands, HOLD)
    reference = machine.pistons(states), states[:, 12:15]
    depth = height - np.array([chain.at(y[:3], y[3:6]).data.oMf[surface.frame].translation[2] for y in states])
    print(f"force {1e6 * depth.max():.0f} N at most, {1e6 * depth[-1]:.0f} N at the end")
    assert 1e6 * depth.max() > 5e3
    steps = (1e-3, 5e-4)
    runs = [History(coupled(ChainPlant(external=surface), cylinders(), h), commands, HOLD) for h in steps]
    found = [errors(run, reference) for run in runs]
    report("contact", steps, found, runs)
    assert found[0][0] < 5e-6
    assert all(run.residual.max() < 3e-4 and not run.trouble for run in runs)
