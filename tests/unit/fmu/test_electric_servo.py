"""The electric servo as an FMU: locked against its closed form, free and in contact against one system for Radau."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from skillframe.cosim import CosimSettings, Master, Motion
from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import find_fmu
from skillframe.fmu.opening import open_actuators

pytestmark = pytest.mark.usefixtures("own_cache", "compiler")
OURS = ("position", "velocity", "acceleration")
READ = ("force", "force_mean", "work", "motor_position", "motor_velocity", "motor_torque", "current", "friction")
P = {
    "gear": 100.0, "rotor_inertia": 5e-5, "torque_constant": 0.1, "current_limit": 0.0, "current_time": 5e-4,
    "viscous_friction": 2.0, "coulomb_friction": 0.0, "presliding": 1e-3, "stiffness": 3000.0, "damping": 3.0,
    "position_gain": 0.0, "velocity_gain": 0.0,
}  # fmt: skip
J = P["gear"] ** 2 * P["rotor_inertia"]
LOOP = {"position_gain": 6000.0, "velocity_gain": 40.0}


def servo(version=2, told="torque", trials=1, **changes):
    inputs = {"command": told, **{name: name for name in OURS}}
    outputs = {name: name for name in READ}
    spec = ActuatorSpec(fmu="electric_servo", parameters={**P, **changes}, inputs=inputs, outputs=outputs)
    return open_actuators([spec], trials, version=version)


def read(bank, name):
    return float(bank.y[0, bank.outputs.index(name)])


def tell(bank, value):
    bank.u[:, bank.inputs.index("command")] = value


def locked(p, command, times):
    """Angle, speed and current of a servo on a joint that stands still, by the matrix exponential."""
    gain, target = (p["position_gain"], True) if p["position_gain"] else (0.0, False)
    per_ampere = p["gear"] * p["torque_constant"]
    spring = [-p["stiffness"] / J, -(p["damping"] + p["viscous_friction"]) / J, per_ampere / J]
    current = [-gain / per_ampere, -p["velocity_gain"] / per_ampere, -1.0]
    a = np.array([[0.0, 1.0, 0.0], spring, np.array(current) / p["current_time"]])
    wanted = (gain * command if target else command) / per_ampere
    rest = np.linalg.solve(a, -np.array([0.0, 0.0, wanted / p["current_time"]]))
    return np.array([rest + expm(a * t) @ -rest for t in times])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("told", "command", "gains"), [("torque", 40.0, {}), ("target", 0.01, LOOP)])
def test_on_a_locked_joint_it_follows_its_closed_form(version, told, command, gains):
    """20 ms in steps of 1 ms, then to rest. An internal step is a fifth of the current's time constant: Runge-Kutta is
    off by 2.6e-6 in each, and five of them add up before they fade."""
    bank = servo(version, told, **gains)
    bank.start(0.0)
    tell(bank, command)
    times = 1e-3 * np.arange(1, 21)
    found = []
    for t in times:
        assert bank.step(t - 1e-3, 1e-3)
        found.append([read(bank, name) for name in ("motor_position", "motor_velocity", "current")])
    exact = locked({**P, **gains}, command, times)
    assert (np.abs(found - exact).max(axis=0) < 1e-5 * np.abs(exact).max(axis=0)).all()
    assert read(bank, "force") == pytest.approx(P["stiffness"] * exact[-1, 0] + P["damping"] * exact[-1, 1], rel=1e-5)
    for k in range(20, 3000):  # its slowest part fades with 5 1/s: e^-15
        bank.step(1e-3 * k, 1e-3)
    serial = P["stiffness"] * LOOP["position_gain"] / (P["stiffness"] + LOOP["position_gain"])
    assert read(bank, "force") == pytest.approx(command if told == "torque" else serial * command, rel=1e-6)
    bank.close()


def test_both_versions_give_the_same_bits():
    banks = [servo(version, coulomb_friction=1.0) for version in (2, 3)]
    for bank in banks:
        bank.start(0.0)
        tell(bank, 25.0)
        bank.u[:, bank.inputs.index("velocity")] = 0.3
        for k in range(50):
            bank.step(1e-3 * k, 1e-3)
    assert banks[0].y.tobytes() == banks[1].y.tobytes()
    for bank in banks:
        bank.close()


class Wheel:
    """An inertia on the servo, free until it meets a wall of stiffness `wall` at the angle `at`."""

    count = 1

    def __init__(self, wall, at=0.02, inertia=0.2):
        self.wall, self.at, self.inertia, self.state = wall, at, inertia, np.zeros(2)

    def rates(self, state, force):
        depth = max(0.0, state[0] - self.at)
        return np.array([state[1], (force - self.wall * depth) / self.inertia])

    def motion(self, force):
        acceleration = self.rates(self.state, float(force[0]))[1]
        return Motion(*(np.array([value]) for value in (*self.state, acceleration)))

    def advance(self, begin, end, step):
        """To rounding: Radau under the force that goes linearly."""

        def rates(t, state):
            return self.rates(state, float(begin[0] + (end[0] - begin[0]) * t / step))

        self.state = solve_ivp(rates, (0.0, step), self.state, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]

    def effective_mass(self):
        return np.array([self.inertia])

    def save(self):
        self.kept = self.state.copy()

    def restore(self):
        self.state = self.kept


def told_at(t):
    """Torque in steps of 10 ms, so that every step of a coupling begins with its own."""
    return 20.0 if int(1e3 * t + 1e-6) // 10 % 5 < 3 else -4.0


def coupled(step, wall, friction, seconds):
    bank, wheel = servo(coulomb_friction=friction), Wheel(wall)
    master = Master(wheel, bank, CosimSettings(step=step))
    master.start(0.0, 0.0)
    found = []
    for k in range(round(seconds / step)):
        assert master.step(told_at(k * step))
        found.append([wheel.state[0], read(bank, "motor_position"), float(master.force[0])])
    residual = float(master.residual[0])
    bank.close()
    return np.array(found), residual


def whole(wall, friction, seconds):
    """Motor, spring, friction and wheel as one system, written here anew, every millisecond."""
    wheel, per_ampere = Wheel(wall), P["gear"] * P["torque_constant"]

    def rates(t, s, torque):
        q, v, angle, speed, current, z = s
        spring = P["stiffness"] * (angle - q) + P["damping"] * (speed - v)
        drag = friction * z / P["presliding"] + P["viscous_friction"] * speed
        return [
            *wheel.rates(np.array([q, v]), spring), speed, (per_ampere * current - drag - spring) / J,
            (torque / per_ampere - current) / P["current_time"], speed - abs(speed) * z / P["presliding"],
        ]  # fmt: skip

    state, found = np.zeros(6), []
    for k in range(round(seconds * 1e3)):
        arguments = (told_at(k * 1e-3),)
        state = solve_ivp(rates, (0.0, 1e-3), state, "Radau", args=arguments, rtol=1e-9, atol=1e-12).y[:, -1]
        spring = P["stiffness"] * (state[2] - state[0]) + P["damping"] * (state[3] - state[1])
        found.append([state[0], state[2], spring])
    return np.array(found)


@pytest.mark.parametrize(
    ("wall", "friction"),
    [
        pytest.param(0.0, 0.0, id="free", marks=pytest.mark.slow),
        pytest.param(0.0, 1.0, id="rough", marks=pytest.mark.slow),
        pytest.param(2e4, 1.0, id="contact"),
    ],
)
def test_coupled_to_an_inertia_it_follows_one_system_with_the_order_of_the_coupling(wall, friction):
    """The error falls with the square of the step: by 16 in two halvings, 9 at least where a wall is met on the way."""
    seconds = 0.1 if wall else 0.06
    exact = whole(wall, friction, seconds)
    errors, residuals = [], []
    for step in (1e-3, 5e-4, 2.5e-4):
        found, residual = coupled(step, wall, friction, seconds)
        errors.append(np.abs(found[round(1e-3 / step) - 1 :: round(1e-3 / step)] - exact).max(axis=0))
        residuals.append(residual)
    span = np.ptp(exact, axis=0)
    assert (errors[0] < [2e-3, 4e-4, 4e-3] * span).all()
    assert errors[2][0] < errors[0][0] / 9.0 and errors[2][1] < errors[0][1] / 9.0
    assert residuals[2] < residuals[0] < 1e-2


def test_work_and_mean_force_are_the_integrals_over_the_step():
    bank = servo(coulomb_friction=1.0)
    fine = servo(coulomb_friction=1.0)
    for one in (bank, fine):
        one.start(0.0)
        one.u[0, [one.inputs.index(name) for name in OURS]] = 0.0, 0.4, 30.0
        tell(one, 30.0)
    assert bank.step(0.0, 1e-3)
    impulse = work = 0.0
    for k in range(1000):
        t = 1e-6 * k
        fine.u[0, [fine.inputs.index(name) for name in OURS]] = 0.4 * t + 15.0 * t * t, 0.4 + 30.0 * t, 30.0
        fine.step(t, 1e-6)
        impulse += 1e-6 * read(fine, "force_mean")
        work += read(fine, "work")
    assert read(bank, "force_mean") == pytest.approx(impulse / 1e-3, rel=1e-6)
    assert read(bank, "work") == pytest.approx(work, rel=1e-6)
    bank.close(), fine.close()


def test_the_current_holds_to_its_limit_and_friction_to_coulomb_s():
    bank = servo(current_limit=3.0, coulomb_friction=1.5)
    bank.start(0.0)
    tell(bank, 500.0)
    for k in range(3000):
        bank.step(1e-3 * k, 1e-3)
    assert read(bank, "current") == pytest.approx(3.0, rel=1e-9)
    assert read(bank, "motor_torque") == pytest.approx(30.0, rel=1e-9)
    assert abs(read(bank, "force") - 30.0) <= 1.5  # what friction, at rest, may hide
    assert abs(read(bank, "friction")) <= 1.5 + 1e-9
    bank.close()


def test_it_starts_in_balance_with_what_it_holds():
    bank = servo(coulomb_friction=1.0, initial_force=-37.0)
    bank.u[:, bank.inputs.index("position")] = 0.4
    bank.start(0.0)
    tell(bank, -37.0)
    assert read(bank, "motor_position") == pytest.approx(0.4 - 37.0 / P["stiffness"], rel=1e-12)
    for k in range(100):
        bank.step(1e-3 * k, 1e-3)
        assert read(bank, "force") == pytest.approx(-37.0, abs=1e-9)
    bank.close()


@pytest.mark.parametrize("told", ["torque", "target"])
def test_model_exchange_follows_co_simulation(told):
    """fmpy's CVode over the rates, against the FMU's own steps."""
    fmpy = pytest.importorskip("fmpy")
    gains = LOOP if told == "target" else {}
    command, path = (0.01 if gains else 40.0), str(find_fmu("electric_servo", version=2))
    values = {**P, **gains, "coulomb_friction": 1.0, told: command}
    result = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", start_values=values, stop_time=0.05, output_interval=1e-3,
        relative_tolerance=1e-9, output=["motor_position", "force"],
    )  # fmt: skip
    bank = servo(told=told, **gains, coulomb_friction=1.0)
    bank.start(0.0)
    tell(bank, command)
    for k in range(50):
        bank.step(1e-3 * k, 1e-3)
    assert result["motor_position"][-1] == pytest.approx(read(bank, "motor_position"), rel=1e-5)
    assert result["force"][-1] == pytest.approx(read(bank, "force"), rel=1e-4)
    bank.close()


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [("stiffness", 0.0, "greater than zero"), ("damping", -1.0, "zero or more"), ("substep", 1e-9, "at least 1e-6 s")],
)
def test_parameters_that_no_servo_has_are_refused(name, value, rule):
    bank = servo(**{name: value})
    try:
        bank.start(0.0)
        problem = bank.problem(0)
    except SkillframeError as error:
        problem = str(error)
    assert f"parameter {name} is {value:g}; it must be {rule}" in problem


def test_a_step_that_would_not_stay_finite_is_discarded_and_the_instance_is_as_before():
    bank = servo()
    bank.start(0.0)
    before = read(bank, "motor_position")
    bank.u[:, bank.inputs.index("position")] = 1e300
    assert not bank.step(0.0, 1e-3)
    assert "no finite motor motion" in bank.problem(0)
    assert before == 0.0
    bank.close()
