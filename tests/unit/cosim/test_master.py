"""The master: second order, stable for light loads, honest about energy, and refused where it cannot be stable."""

import math

import numpy as np
import pytest
from cosim_fakes import CYLINDER, Boom, monolithic

from skillframe.cosim import CosimSettings, Master, bond_work, coupling_numbers, require_stable
from skillframe.cosim.coupling import StepTooLarge
from skillframe.cosim.energy_balance import BLOCK, BondLedger
from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.opening import open_actuators

HOLD, ALL = 5, ("command", "position", "velocity", "acceleration")
COMMANDS = [0.35 * math.sin(2 * math.pi * 1.2 * k * HOLD * 1e-3) for k in range(60)]


@pytest.fixture(autouse=True)
def _with_a_compiler(compiler):
    pass


def lifted(mass, step=1e-3, names=ALL, parameters=None, **settings):
    """A boom held by its cylinder, and the master that couples them, started."""
    boom = Boom(mass)
    values = CYLINDER | {"initial_force": boom.holding_force()} | (parameters or {})
    spec = ActuatorSpec(fmu="hydraulic_cylinder", parameters=values, inputs={n: n for n in names}, name="lift")
    bank = open_actuators([spec])
    master = Master(boom, bank, CosimSettings(step=step, **settings))
    master.start()
    return master


def moved(master, commands=COMMANDS):
    """Rows of (q, q', p_a) every millisecond."""
    each, rows = round(1e-3 / master.settings.step), []
    for u in commands:
        for _ in range(HOLD):
            for _ in range(each):
                assert master.step(u), master.trouble()
            rows.append((*master.plant.state, master.bank.y[0, 3]))
    master.bank.close()
    return np.array(rows)


def rms(rows, reference):
    """Root mean square of the rate's error over its range, and largest pressure error [bar]."""
    e = rows - reference
    return math.sqrt(np.mean(e[:, 1] ** 2)) / np.ptp(reference[:, 1]), np.max(np.abs(e[:, 2])) / 1e5


# load [kg]: error of the boom's rate and of the pressure [bar] at 1 ms, as measured for this algorithm before
PUBLISHED = {400.0: (7.0e-5, 0.014), 20.0: (2.1e-3, None), 5.0: (3.9e-3, None)}


@pytest.mark.slow
@pytest.mark.parametrize("mass", PUBLISHED)
@pytest.mark.figures
def test_a_boom_follows_one_system_solved_by_radau_within_twice_the_earlier_figures(mass):
    boom = Boom(mass)
    reference = monolithic(boom, CYLINDER | {"initial_force": boom.holding_force()}, COMMANDS, HOLD)
    rate, pressure = rms(moved(lifted(mass)), reference)
    print(f"{mass:g} kg: rate {rate:.1e}, pressure {pressure:.1e} bar")
    assert rate < 2 * PUBLISHED[mass][0]
    assert PUBLISHED[mass][1] is None or pressure < 2 * PUBLISHED[mass][1]


@pytest.mark.parametrize(("names", "least"), [(ALL, 1.8), (ALL[:3], 1.0)], ids=["acceleration", "velocity only"])
def test_the_coupling_is_of_second_order_with_the_acceleration_and_above_the_first_without(names, least):
    commands = COMMANDS[:30]
    finest = moved(lifted(400.0, 1e-3 / 16), commands)
    errors = [rms(moved(lifted(400.0, h, names), commands), finest)[0] for h in (1e-3, 5e-4, 2.5e-4)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    # 1.8 to 2.2 is the band; without the acceleration only the first order is promised
    assert ((orders > least) & (orders < 2.2)).all(), (errors, orders)


@pytest.mark.parametrize("mass", [400.0, 20.0, 5.0])
def test_a_millisecond_is_stable_and_makes_no_energy(mass):
    master = lifted(mass)
    moved(master)
    # below the bound for three cylinders in free motion
    assert master.residual[0] < 3e-4
    assert master.trouble() == {}


def test_the_residual_falls_with_the_square_of_the_step():
    values = []
    for h in (1e-3, 5e-4):
        master = lifted(20.0, h)
        moved(master, COMMANDS[:30])
        values.append(master.residual[0])
    assert 3.0 < values[0] / values[1] < 6.0


def test_an_unstable_step_is_refused_with_its_number_and_one_that_would_do():
    master = lifted(0.5)
    numbers = coupling_numbers(master.bank, master.plant.effective_mass(), 1e-3)
    with pytest.raises(StepTooLarge, match=r"lift: with a step of 1 ms omega_h H = 2.1 .* take 0.49 ms or less"):
        require_stable(numbers, 1e-3, ["lift"])
    fine = all(master.step(u) for u in COMMANDS for _ in range(HOLD))
    assert not fine or master.residual[0] > 1.0  # and rightly so
    assert master.trouble()
    master.bank.close()


def test_a_step_that_is_stable_and_coarse_is_warned_about():
    master, said = lifted(5.0), []
    numbers = coupling_numbers(master.bank, master.plant.effective_mass(), 1e-3)
    require_stable(numbers, 1e-3, ["lift"], said.append)
    assert len(said) == 1 and "omega_h H = 0.65" in said[0]
    require_stable(
        coupling_numbers(master.bank, master.plant.effective_mass() * 100, 1e-3), 1e-3, ["lift"], pytest.fail
    )
    master.bank.close()


def test_friction_that_answers_at_once_is_found_and_refused():
    master = lifted(20.0, parameters={"viscous_friction": 1e6})
    numbers = coupling_numbers(master.bank, master.plant.effective_mass(), 1e-3)
    # the seals' spring is deflected by the trial's own speed only after a step, so at once there is the viscous law
    assert numbers.feedthrough[0] == pytest.approx(1e6, rel=1e-6)
    with pytest.raises(StepTooLarge, match="c H/m = 3"):
        require_stable(numbers, 1e-3, ["lift"])
    master.bank.close()


def test_the_frequency_is_that_of_oil_and_seals_on_the_mass():
    master = lifted(400.0)
    mass = master.plant.effective_mass()
    p_a, p_b = math.pi / 4 * 0.08**2, math.pi / 4 * (0.08**2 - 0.045**2)
    oil = 1.2e9 * (p_a**2 / (3e-4 + p_a * 0.3) + p_b**2 / (3e-4 + p_b * 0.3))
    numbers = coupling_numbers(master.bank, mass, 1e-3)
    # over one step at 1 mm/s the seals give by 1 um of 500: 0.1 %; leakage 1e-13 relaxes less
    assert numbers.stiffness[0] == pytest.approx(oil + 4000 / 5e-4, rel=2e-3)
    master.bank.close()


def test_trying_the_coupling_out_changes_nothing():
    a, b = lifted(20.0), lifted(20.0)
    coupling_numbers(a.bank, a.plant.effective_mass(), 1e-3)
    np.testing.assert_array_equal(moved(a, COMMANDS[:10]), moved(b, COMMANDS[:10]))


def test_halving_makes_small_steps_only_where_they_are_needed():
    plain, halving = lifted(5.0), lifted(5.0, tolerance_j=1e-4)
    commands = [0.0] * 20 + [0.6] * 3 + [0.0] * 20
    finest = moved(lifted(5.0, 1e-3 / 16), commands)
    rows = [moved(m, commands) for m in (plain, halving)]
    coarse, fine = (np.max(np.abs((r - finest)[:, 2])) for r in rows)
    assert fine < coarse / 2
    assert plain.steps < halving.steps < 8 * plain.steps
    assert halving.time == pytest.approx(plain.time, abs=1e-12)


def test_halving_without_rollback_and_unequal_bonds_are_refused():
    master = lifted(400.0)

    class Forgetful:
        def __init__(self, bank):
            self._bank = bank

        def __getattr__(self, name):
            return getattr(self._bank, name)

        def capabilities(self, index):
            return self._bank.capabilities(index)._replace(rollback=False)

    with pytest.raises(SkillframeError, match="step halving needs"):
        Master(Boom(1.0), Forgetful(master.bank), CosimSettings(tolerance_j=1e-3))
    two = Boom(1.0)
    two.count = 2
    with pytest.raises(SkillframeError, match="2 bonds and there are 1 actuators"):
        Master(two, master.bank)
    master.bank.close()


def test_multi_rate_gives_the_same_motion():
    rows = [
        moved(lifted(20.0, **rates), COMMANDS[:20]) for rates in ({}, {"plant_substeps": 4}, {"actuator_substeps": 4})
    ]
    for other in rows[1:]:
        # the parts see the same parabola and the same line of force: they differ by the parts' own accuracy
        assert rms(other, rows[0])[0] < 1e-4


def test_the_work_of_a_linear_force_on_a_cubic_path_is_exact():
    rng = np.random.default_rng(0)
    for _ in range(20):
        c, (f0, f1), h = rng.normal(size=4), rng.normal(size=2), rng.uniform(0.1, 2)
        x, v = np.poly1d(c), np.poly1d(c).deriv()
        exact = (np.poly1d([(f1 - f0) / h, f0]) * v).integ()(h)
        assert bond_work(f0, f1, x(h) - x(0), v(0), v(h), h) == pytest.approx(exact, rel=1e-11, abs=1e-12)


def test_a_ledger_sums_steps_of_any_length_however_seldom_it_is_asked_and_goes_back_to_what_was_kept():
    rng, ledger = np.random.default_rng(0), BondLedger(3)
    lost, exchanged = np.zeros(3), np.zeros(3)
    for k in range(2 * BLOCK + 3):
        f0, f1, x0, x1, v0, v1, given = rng.normal(size=(7, 3))
        step = 1e-3 * (1 + k % 3)
        ledger.add((f0, f1), (x0, x1), (v0, v1), given, step)
        work = bond_work(f0, f1, x1 - x0, v0, v1, step)
        lost, exchanged = lost + work - given, exchanged + np.abs(work)
        if k == 50:
            kept = ledger.sums().copy()
            np.testing.assert_array_equal(kept, [lost, exchanged])  # the same additions one after the other
    np.testing.assert_array_equal(ledger.sums(), [lost, exchanged])
    ledger.add((f0, f1), (x0, x1), (v0, v1), given, step)
    ledger.restore(kept)
    np.testing.assert_array_equal(ledger.sums(), kept)
    ledger.start()
    assert not ledger.sums().any()


def test_a_failed_actuator_is_named_and_the_master_says_so():
    master = lifted(400.0)
    master.plant.state[0] = math.radians(120.0)
    assert not master.step(0.0)
    assert "outside the stroke" in master.trouble()[0]
    master.bank.close()
