"""CPU times of the batched loop and of what it is held against. Wall time on a shared machine says little."""

import time

import numpy as np

from skillframe.execution.executor import simulate
from skillframe.world.convert import build_spec
from skillframe.world.layout import Layout
from skillframe.world.plant import Plant
from skillframe.world.sensors import TARE_TICKS
from tests.laws.runs import generators


class Recorded:
    """Measures the plant's share of a run after its tare, and keeps the torques of some trials, by standing between."""

    def __init__(self, keep=0):
        self.keep, self.seconds, self.torques, self.start, self.calls = keep, 0.0, [], None, 0

    def __enter__(self):
        self.original = Plant.step

        def step(plant, torque, ids):
            if self.start is None:
                self.start = [array.copy() for array in plant.state] + [
                    plant._mocap_pos.copy(),
                    plant._mocap_quat.copy(),
                ]
            if self.keep:
                self.torques.append(torque[: self.keep].copy())
            self.calls += 1
            before = time.process_time()
            self.original(plant, torque, ids)
            self.seconds += (time.process_time() - before) * (self.calls > TARE_TICKS)

        Plant.step = step
        return self

    def __exit__(self, *exception):
        Plant.step = self.original


def timed_run(skill, setting, draws, count, duration, trace_hz=100.0):
    """CPU seconds per trial and simulated second of the ticks alone, without set-up, and the result."""
    marks = []
    result = simulate(
        skill, setting, draws, generators(count), duration_s=duration, trace_hz=trace_hz,
        progress=lambda now: marks.append((now, time.process_time(), time.perf_counter())),
    )  # fmt: skip
    simulated = marks[-1][0] - marks[0][0]
    cpu, wall = ((marks[-1][i] - marks[0][i]) / simulated / count for i in (1, 2))
    return cpu, wall, result


def replay(setting, recorded):
    """CPU seconds per trial and simulated second of bare `mj_step` under the torques of a run, its tare not counted."""
    import mujoco

    model = build_spec(setting.robot, setting.scene).compile()
    torques = np.array(recorded.torques)
    data, seconds = mujoco.MjData(model), 0.0
    for trial in range(torques.shape[1]):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = recorded.start[0][trial], recorded.start[1][trial]
        data.mocap_pos[:], data.mocap_quat[:] = recorded.start[2][trial], recorded.start[3][trial]
        mujoco.mj_forward(model, data)
        for tick, torque in enumerate(torques[:, trial]):
            if tick == TARE_TICKS:
                before = time.process_time()
            data.qfrc_applied[:] = torque
            mujoco.mj_step(model, data)
        seconds += time.process_time() - before
    return seconds / torques.shape[1] / ((len(torques) - TARE_TICKS) * model.opt.timestep)


def one_trial_loop(setting, direction, stiffness, speed, draws, trials, ticks):
    """CPU seconds per trial and simulated second of a loop over one trial at a time, Pinocchio and `mj_step`.

    It does what the batched tick does: sensor noise, Kalman filter, push, equation (1), limits, a row of the trace.
    """
    from skillframe.world.placement import fixture_poses, start_configurations
    from tests.laws.pinocchio_loop import Loop
    from tests.laws.pushing import FORCE_CAP

    robot, scene = setting.robot, setting.scene
    draws = {key: values[:trials] for key, values in draws.items()}
    starts, fixtures = start_configurations(robot, scene, draws, trials), fixture_poses(robot, draws, trials)
    model = build_spec(robot, scene).compile()
    layout, seconds = Layout(model), 0.0
    for i in range(trials):
        start = layout.to_mujoco(robot.model, starts[i : i + 1])[0]
        place = fixtures.position[i], np.array([1.0, 0.0, 0.0, 0.0])
        loop = Instrumented(Loop)(robot, scene, model, setting.center_of_compliance, start, place)
        before = time.process_time()
        loop.run(direction, stiffness, speed, FORCE_CAP, ticks)
        seconds += time.process_time() - before
    return seconds / trials / ((ticks + 100) * model.opt.timestep)


def Instrumented(base):  # noqa: N802
    """The witness loop with what a real tick has besides the law: noise, filter, limits, trace."""

    class WithSensors(base):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.rng, self.slope, self.value = np.random.default_rng(0), np.zeros(6), np.zeros(6)
            self.rows, self.previous, self.energy = [], None, 0.0

        def step(self, wanted, stiffness, twist):
            noise = self.rng.standard_normal(12)
            reading = -self.data.sensordata + 0.3 * noise[:6]
            value = self.value + 1e-3 * self.slope
            error = reading - value
            self.value, self.slope = value + 0.2 * error, self.slope + 20.0 * error
            self.body.position = self.body.position + 5e-5 * noise[6:9]
            if self.value[:3] @ self.value[:3] > 1e12 or not np.isfinite(self.value).all():
                raise RuntimeError("limit")
            self.energy += 1e-3 * float(self.value @ self.body.twist)
            super().step(wanted, stiffness, twist)
            if self.tick % 10 == 0:
                row = (self.tick, *self.body.position, *self.body.rotation.ravel(), *self.body.twist, *self.value)
                self.rows.append(row)

    return WithSensors
