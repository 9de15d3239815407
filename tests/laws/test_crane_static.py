"""The crane at rest and nearly so: pressures that hold it, and the three oscillations of mass on oil."""

import numpy as np
import pytest
from scipy.linalg import eigh

from skillframe.fmu.build import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401
from tests.laws.crane_exudyn import Crane
from tests.laws.crane_plants import START, ChainPlant, areas, coupled, crane, cylinders, simulated, tooled

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
NO_FRICTION = {"coulomb_friction": 0.0, "static_friction": 0.0, "viscous_friction": 0.0, "leakage": 0.0}
POSES = [START, (0.9, -2.0, 0.2), (0.6, -1.2, 0.9), (1.2, -1.0, 0.3)]


def closed_form(cylinder, force, low=30e5):
    """Pressures (a, b) that hold a force, the lower one given."""
    a, b = areas(cylinder)
    over = force - (a - b) * low
    return (low + over / a, low) if over > 0 else (low, low - over / b)


@pytest.mark.parametrize("z", POSES)
@pytest.mark.slow
def test_without_friction_the_coupled_crane_stays_at_the_closed_form_pressures(z):
    plant = ChainPlant(z)
    master = coupled(plant, cylinders(**NO_FRICTION), 1e-3, z=z)
    for _ in range(50):
        assert master.step(0.0), master.trouble()
    pressures = master.bank.y[:, [3, 4]].copy()
    master.bank.close()
    force = crane().at(np.array(z), np.zeros(3)).holding_force()
    expected = [closed_form(c, f) for c, f in zip(cylinders(), force, strict=True)]
    np.testing.assert_allclose(pressures, expected, rtol=1e-10)
    np.testing.assert_allclose(plant.z, z, atol=1e-12)


@pytest.mark.parametrize("z", POSES)
def test_the_holding_pressures_hold_the_crane_of_an_independent_multibody_code(z):
    pytest.importorskip("exudyn", reason="exudyn is a dependency of development")
    force = crane().at(np.array(z), np.zeros(3)).holding_force()
    pressures = [closed_form(c, f) for c, f in zip(cylinders(), force, strict=True)]
    history = Crane(crane(), z, cylinders(), pressures).run(np.zeros((20, 3)), 5e-3, 1e-3)
    # its Newton iteration stops at 1e-8 of forces of 50 kN: a force error of 5e-4 N on oil of 1e6 N/m
    assert np.abs(history.piston - history.piston[0]).max() < 1e-9


def stiffness(z, geometric=True):
    """Of the closed valves in minimal coordinates: oil through the moment arms, load through their change, gravity."""
    chain, z, step = tooled(), np.asarray(z), 1e-6
    rest = chain.at(z, np.zeros(3))
    force, x = rest.holding_force(), rest.driven_motion[0]
    oil = []
    for c, position in zip(cylinders(), x, strict=True):
        (a, b), modulus = areas(c), c["bulk_modulus"]
        volumes = c["dead_volume_a"] + a * position, c["dead_volume_b"] + b * (c["stroke"] - position)
        oil.append(modulus * (a**2 / volumes[0] + b**2 / volumes[1]))
    result = rest.arms.T @ np.diag(oil) @ rest.arms
    if not geometric:
        return result
    for i, axis in enumerate(np.eye(3)):
        ahead, behind = (chain.at(z + s * step * axis, np.zeros(3)) for s in (1, -1))
        drive = [s.arms.T @ force - s.gravity for s in (ahead, behind)]
        result[:, i] -= (drive[0] - drive[1]) / (2 * step)
    return 0.5 * (result + result.T)


def period(z, shape, hertz, step=5e-4):
    """Of the co-simulated crane set moving in one shape: time between rising zeros of the modal coordinate."""
    chain, plant = tooled(), simulated(step, z)
    mass = chain.at(np.asarray(z), np.zeros(3)).mass
    speed = 2e-5 * 2 * np.pi * hertz / np.abs(shape).max()
    moving = chain.at(np.asarray(z), speed * shape).v
    qpos, qvel = (part.copy() for part in plant.plant.state)
    for name, v in zip(list(chain.model.names)[1:], moving, strict=True):
        qvel[0, plant.plant.model.joint(name).dofadr[0]] = v
    plant.plant.set_state(qpos, qvel, np.arange(1))
    master = coupled(plant, cylinders(**NO_FRICTION), step, chain=chain, z=z)
    weights, rows = mass @ shape, []
    for _ in range(int(4.3 / hertz / step)):
        assert master.step(0.0), master.trouble()
        q = plant.plant.configuration[0]
        rows.append(weights @ (chain.minimal(q) - z))
    master.bank.close()
    m = np.array(rows)
    rising = np.flatnonzero((m[:-1] < 0) & (m[1:] >= 0))
    return np.diff((rising - m[rising] / (m[rising + 1] - m[rising])) * step).mean()


@pytest.mark.slow
@pytest.mark.parametrize("z", [START, (0.3, -1.2, 0.2), (0.9, -1.8, 0.6)])
def test_the_natural_frequencies_are_those_of_theory_with_geometric_stiffness(z):
    """Within 0.5 %. Leaving out the load's stiffness would miss the lowest by more than that."""
    mass = tooled().at(np.asarray(z), np.zeros(3)).mass
    squares, shapes = eigh(stiffness(z), mass)
    oil_alone = np.sqrt(eigh(stiffness(z, geometric=False), mass)[0]) / (2 * np.pi)
    theory = np.sqrt(squares) / (2 * np.pi)
    measured = np.array([1.0 / period(z, shape, hertz) for shape, hertz in zip(shapes.T, theory, strict=True)])
    print(f"{z}: theory {theory} Hz, measured/theory - 1 {measured / theory - 1}, oil alone {oil_alone / theory - 1}")
    np.testing.assert_allclose(measured, theory, rtol=5e-3)
    assert abs(oil_alone[0] / theory[0] - 1) > 5e-3
