"""Prints the project's speed and memory figures, each beside its bound. `make bench` runs it.

Ratios are taken side by side in one run and from CPU time, so that they hold on a busy machine too. A bound that is
missed is marked; the exit code is 0 all the same, because a benchmark is read, not gated.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from skillframe.campaign.runner import CHUNK  # noqa: E402
from skillframe.world.quantities import SensorSettings  # noqa: E402
from tests.benchmarks import crane, engine, interfaces, parts, runner, segmenter  # noqa: E402
from tests.benchmarks.timing import Recorded, one_trial_loop, replay, timed_run  # noqa: E402
from tests.laws.pushing import Push, impedance  # noqa: E402
from tests.laws.runs import setup  # noqa: E402

DOWN = (0.0, 0.0, -1.0)
HEAVY = {"scipy", "casadi", "fmpy", "filterpy", "mujoco", "matplotlib", "pinocchio"}
CASES = {
    "arm in the valley": ("panda", "valley", impedance("x"), 0.03, 2.0),
    "arm with the peg": ("panda", "peg_in_hole", impedance("x", "y"), 0.02, 1.5),
    "free tool with the peg": ("free_tool", "peg_in_hole", impedance("x", "y"), 0.02, 1.5),
}
COUNT, REPLAYED, REPEATS = 256, 24, 5  # the round with the median ratio is shown, and the median law of all rounds


def show(what, value, unit, bound=None, below=True):
    """One line: the figure, its bound, and whether it is met."""
    verdict = ""
    if bound is not None:
        met = value < bound if below else value > bound
        verdict = f"  bound {'<' if below else '>'} {bound:g} {unit}: {'met' if met else 'MISSED'}"
    print(f"{what:<66} {value:9.3g} {unit}{verdict}", flush=True)


def case(name, count=COUNT):
    robot, world, stiffness, speed, duration = CASES[name]
    setting = replace(setup(robot, world), sensors=SensorSettings())
    if world == "valley":
        draws = {"start.offset_x": np.linspace(-0.03, 0.03, count)}
    else:
        draws = {"start.tilt_y": np.linspace(-0.12, 0.12, count)}
    return setting, draws, stiffness, speed, duration


def batch(name):
    """A chunk of a campaign, which keeps no traces, against the floor; the same of 256 with a trace; one at a time."""
    chunk, large = (rounds(name, count, trace) for count, trace in ((CHUNK, None), (COUNT, 100.0)))
    floor, cpu, _ = chunk
    show(f"{name}: bare mj_step", 1e3 * floor, "us/ms")
    show(f"{name}: chunk of {CHUNK} without traces", 1e3 * cpu, "us/ms")
    show(f"{name}: chunk of {CHUNK} over bare mj_step", cpu / floor, "x", 1.3)
    floor, cpu, law = large
    show(f"{name}: batch of {COUNT} with a trace at 100 Hz over bare mj_step", cpu / floor, "x", 1.3)
    setting, draws, stiffness, speed, duration = case(name)
    alone = one_trial_loop(setting, np.array(DOWN), stiffness, speed, draws, 4, round(1000 * duration))
    show(f"{name}: one-trial loop", 1e3 * alone, "us/ms")
    bound = 4.0 if "valley" in name else 1.3
    show(f"{name}: one-trial loop over batch of {COUNT}", alone / cpu, "x", bound, below=False)
    # the same operations as in the valley, on arrays that the contacts of 256 trials have pushed out of the caches:
    # emptied by 64 MB of other writes after each step, the valley's figure rises to the peg's
    show(f"{name}: skill, law, filter, trace", 1e3 * law, "us/ms", 3.0)


def rounds(name, count, trace_hz):
    """Of a batch: CPU seconds per trial and simulated second of bare mj_step and of all, and the median without it."""
    setting, draws, stiffness, speed, duration = case(name, count)
    taken = []
    for _ in range(REPEATS):
        skill = Push(DOWN, stiffness, speed=speed, stall=False)
        with Recorded(keep=REPLAYED) as recorded:
            cpu, _, _ = timed_run(skill, setting, draws, count, duration, trace_hz)
        taken.append((replay(setting, recorded), cpu, cpu - recorded.seconds / count / duration))
    floor, cpu, _ = sorted(taken, key=lambda r: r[1] / r[0])[len(taken) // 2]
    return floor, cpu, float(np.median([r[2] for r in taken]))


def single(name, bound):
    """One run, N = 1, with a rather fine trace, in contact for nearly all of it."""
    setting, draws, stiffness, speed, duration = case(name)
    draws = {key: values[-40:-39] for key, values in draws.items()}
    skill = Push(DOWN, stiffness, speed=speed, stall=False)
    cpu, wall, result = timed_run(skill, setting, draws, 1, 2.0 * duration)
    touching = np.mean(np.abs(result.traces[0].wrench_true[:, :3]).sum(-1) > 0.0)
    show(
        f"{name}, one run, in contact {100 * touching:.0f} % of the time: real time", 1.0 / cpu, "x", bound, below=False
    )
    show(f"{name}, one run, by wall time", 1.0 / wall, "x")


def two_arms():
    """A batch of 32 insertions with two arms in contact, each trial against real time."""
    from skillframe.errors import UnknownName
    from skillframe.execution.drives.arms import simulate_arms
    from skillframe.execution.executor import Setup
    from skillframe.execution.prepare import load_robot_model, load_world
    from skillframe.extend.registry import registry
    from tests.laws.runs import generators

    try:
        kind = registry().coordinator("dual_arm")
    except UnknownName:
        print("two arms: the plug-in is not installed")
        return
    scene, count, marks = load_world("dual_peg", {}), 32, []
    tip = list(scene.tool.frames["tip"])
    arm = {"center_of_compliance": tip, "compliant": ["translation", "rotation"]}
    document = {"phases": [{"arms": [{**arm, "share": 1.0}, {**arm, "compliant": [], "share": 0.0}]}]}
    setting = Setup(robot=load_robot_model("dual_panda"), scene=scene, center_of_compliance=kind.centers(document))
    simulate_arms(
        kind.build(document), setting, {"start.tilt_y": np.linspace(-0.1, 0.1, count)}, generators(count),
        duration_s=4.0, trace_hz=100.0, progress=lambda now: marks.append((now, time.process_time())),
    )  # fmt: skip
    (first, begun), (last, ended) = marks[0], marks[-1]
    show(
        f"two arms, batch of {count}: real time of each trial",
        count * (last - first) / (ended - begun),
        "x",
        8.0,
        below=False,
    )


def memory():
    """Resident and virtual memory of 256 trials, in a process of its own, then of a long run with a fine trace."""
    for what in ("batch", "long"):
        text = subprocess.run(
            [sys.executable, __file__, f"--memory-{what}"], capture_output=True, text=True, check=True
        ).stdout
        for line in text.splitlines():
            label, value, bound = line.split("|")
            show(label, float(value), "MB", float(bound) if bound else None)


def status(key):
    """A line of the process's status [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return float(line.split()[1]) / 1024.0
    return float("nan")


def memory_of_batch():
    setting, draws, stiffness, speed, _ = case("arm with the peg")
    before = status("VmSize")
    timed_run(Push(DOWN, stiffness, speed=speed, stall=False), setting, draws, COUNT, 5.0)
    print(f"256 trials of 5 s with 100 Hz traces: peak resident|{status('VmHWM')}|500")
    print(f"256 trials of 5 s with 100 Hz traces: virtual growth|{status('VmPeak') - before}|1000")


def memory_of_long_run():
    setting, draws, stiffness, speed, _ = case("arm in the valley")
    one = {key: values[:1] for key, values in draws.items()}
    marks = {}

    def note(now):
        marks[round(now)] = status("VmRSS")

    from skillframe.execution.executor import simulate
    from tests.laws.runs import generators

    skill = Push(DOWN, stiffness, speed=speed, stall=False)
    simulate(skill, setting, one, generators(1), duration_s=100.0, trace_hz=1000.0, progress=note)
    print(f"a long run at 1 kHz: resident at 30 s|{marks[30]}|")
    print(f"a long run at 1 kHz: further growth to 100 s|{marks[99] - marks[30]}|20")


def command_line():
    best = np.inf
    for _ in range(5):
        before = time.perf_counter()
        subprocess.run([Path(sys.executable).with_name("skillframe"), "--help"], capture_output=True, check=True)
        best = min(best, time.perf_counter() - before)
    show("skillframe --help, best of 5", best, "s", 0.5)
    code = (
        "from skillframe.cli.main import run; run(['--help']); import sys; print([m for m in %r if m in sys.modules])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code % (HEAVY,)], capture_output=True, text=True, cwd=ROOT, check=True
    )
    show("heavy libraries it imports", len(eval(loaded.stdout.splitlines()[-1])), "", 1)


def learning():
    from skillframe_teaching.sessions import record
    from skillframe_teaching.teacher import TeacherSettings

    from skillframe.errors import UnknownName
    from skillframe.extend import LearnOptions
    from skillframe.extend.registry import registry

    try:
        learn = registry().skill("lmc").learn
    except UnknownName:
        print("LMC fit: the plug-in is not installed")
        return
    setting = setup("free_tool", "valley")
    slow = TeacherSettings(speed=0.004)
    demonstrations = record(setting.robot, setting.scene, slow, count=2, seed=1, duration_s=20.0).demonstrations
    ten = [d.between(d.time[0], d.time[0] + 10.0) if d.duration > 10.0 else d for d in demonstrations]
    learn(ten, LearnOptions())
    taken = []
    for _ in range(7):
        before = time.process_time()
        learn(ten, LearnOptions())
        taken.append(time.process_time() - before)
    lengths = ", ".join(f"{d.duration:.1f} s" for d in ten)
    show(
        f"LMC fit of 2 demonstrations ({lengths}, {ten[0].rate:.0f} Hz), median of 7",
        1e3 * float(np.median(taken)),
        "ms",
        50.0,
    )


def main():
    command_line()
    learning()
    for name in CASES:
        batch(name)
    single("arm in the valley", 6.0)
    single("arm with the peg", 6.0)
    two_arms()
    interfaces.ratios(show)
    interfaces.real_time(show)
    runner.rows(show)
    parts.rows(show)
    crane.rows(show)
    segmenter.measure(show)
    engine.rows(show)
    memory()


if __name__ == "__main__":
    {"--memory-batch": memory_of_batch, "--memory-long": memory_of_long_run}.get(sys.argv[-1], main)()
