"""Rehearsals through the makers' client libraries: `python -m tests.figures.rehearsed {pairs|faults|show} FILE ...`.

    python -m tests.figures.rehearsed pairs FILE ur valley     # ur or franka, valley or peg_in_hole
    python -m tests.figures.rehearsed faults FILE franka 100   # ur, franka or ros2, and how many
    python -m tests.figures.rehearsed show FILE

`pairs`: 64 Sobol draws of a box, each run by the client library against the fake robot in lockstep, and by the
simulation loop. The valley's box is that of `tests.figures.held`, with starts 20 to 30 mm high; the peg's that of the
tutorial's campaign, with frictions of 0.1 to 0.4 and starts 2 to 10 mm above the rim. `faults`: random faults at random
times, against `skillframe drive run` in a process of its own. FILE keeps a JSON line for each run that is done.
Fakes share the simulation's plant: this tests protocol, clock and frames, and nothing about a real robot.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

import skillframe
from plugins.drive.tests.rehearsal import COMMAND, ENVIRONMENT, PATIENT, cell, host
from skillframe.campaign.statistics import clopper_pearson
from skillframe.execution import load_robot_model, load_world, prepare, simulate
from tests.figures.rehearsing import FAKES, FORK, LENGTHS, SENSOR, Plan, ended, host_of, ready

BOXES = {
    "valley": {"fixture.offset_x": (-0.015, 0.015), "fixture.tilt_y": (-0.2, 0.2), "world.friction": (0.1, 0.4),
               "start.offset_z": (0.02, 0.03)},
    "peg_in_hole": {"fixture.offset_x": (-0.008, 0.008), "fixture.tilt_y": (-0.12, 0.12), "world.friction": (0.1, 0.4),
                    "start.offset_z": (0.002, 0.01)},
}  # fmt: skip
COC = {"valley": None, "peg_in_hole": "tip"}
PAIRS = 64
LONGEST_S = {"valley": 30.0, "peg_in_hole": 8.0}
"""Time limits; the peg's is that of the tutorial's campaign. A robot that takes positions has twice as long."""
TRUTH = {"start.offset_z": 0.01, "fixture.offset_x": 0.004}
"""Of the runs with faults, as the how-to page's rehearsal."""
RUN_S = {"ur": 8.0, "franka": 4.0, "ros2": 4.0}
"""How long that run takes without a fault [s]: the UR5e's ends by time, which is twice --duration."""
WITHIN_S, GONE_S = 0.06, 1.0
"""What is asked: times within which the motion has ended and the runner gone."""
STOPS = {
    "protective_stop": r"protective or emergency stop|in the mode|aborted by reflex|program has stopped|no state",
    "cut": r"no state|[Tt]imeout|connection|program has stopped|no (Universal|Franka) [Rr]obot|does not|publishe",
    "stall": r"no state|[Tt]imeout|program has stopped|states? of the robot were lost|reflex|publishe",
    "hung": r"no state|states of the robot were lost|program has stopped|reflex|[Tt]imeout|no target",
    "lost_states": r"no state|states of the robot were lost|reflex|program has stopped|[Tt]imeout",
    "lost_commands": r"reflex",
    "killed": r"", "terminated": r"", "interrupted": r"interrupted",
}  # fmt: skip
"""Faults that end a run, and how the sentence may name them."""
OF_LINK = r"interrupted|the (robot|first target|target|controller|process)|no |\d+ states|another program|/joint"
"""How sentences begin that name a fault of a link, and not of the skill."""
SETTINGS = {"world.friction": (0.4, 1.5), "fixture.offset_x": (-0.03, 0.03), "fixture.tilt_y": (-0.5, 0.5),
            "start.offset_z": (0.0, 0.08), "start.offset_x": (-0.02, 0.02), "sensor.force_bias_x": (-50.0, 50.0),
            "sensor.torque_bias_y": (-5.0, 5.0), "sensor.force_noise": (0.0, 5.0), "robot.joint_friction": (0.0, 3.0),
            "robot.mass_scale": (0.7, 1.4), "grasp.tilt_y": (-0.2, 0.2)}  # fmt: skip
"""What `--set` may make true from the beginning, and the range."""
ASKED = "The robot will move. Type move: "
MOST_TRIES = 5


def kept(path: Path) -> list[dict[str, Any]]:
    """The lines of a file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []


def add(path: Path, **record: Any) -> None:
    """Write a line."""
    with path.open("a") as file:
        file.write(json.dumps(record, default=float) + "\n")


def learned(world: str, folder: Path) -> Path:
    """The skill of a world, learned once from two demonstrations, as in the plug-ins' tests."""
    path = folder / f"{world}.skill.json"
    if not path.is_file():
        skillframe.learn(skillframe.record(world, count=2, seed=3)).save(path)
    return path


def run_linked(skill: Path, link: str, world: str, fake: Any, back: Any) -> None:
    """The run of a pair, in a process that the client library has for itself. The fake's truth is the witness."""
    import skillframe_drive.link

    skillframe_drive.link.SILENT_S = 5.0  # in lockstep the robot's clock stands while the machine is busy
    from skillframe_drive.cell import Cell
    from skillframe_drive.runs import load_task, open_link, run_once

    def done() -> bool:
        fake.send("goal")
        return bool(fake.recv())

    task = load_task(Cell(robot=FAKES[link][2], link=link, host=host_of(os.getppid()), world=world, force_n=1000.0))
    opened = open_link(task.cell)
    try:
        run = run_once(skillframe.LearnedSkill.load(skill), task, opened, coc=COC[world], slow=1.0, dry=False,
                       duration_s=LONGEST_S[world], rate_hz=100.0, done=done)  # fmt: skip
        back.send({**outcome(run), "missed": run.trace.meta["missed"]})
    finally:
        opened.close()


def outcome(run: Any) -> dict[str, Any]:
    """What is compared, and why the run ended."""
    return {"success": run.success, "duration_s": run.duration_s, "peak_n": run.peak_force_n, "failure": run.failure,
            "reason": run.reason, "filtered_n": run.trace.meta["peak_force_filtered_n"]}  # fmt: skip


def pairs(path: Path, link: str, world: str) -> None:
    """Run the pairs that the file lacks."""
    skill, names = learned(world, path.parent), list(BOXES[world])
    low, high = np.array(list(BOXES[world].values())).T
    points = low + (high - low) * qmc.Sobol(len(names), rng=np.random.default_rng(7)).random(PAIRS)
    have = {(each["link"], each["world"], each["number"]) for each in kept(path) if each["part"] == "pair"}
    lacking = [number for number in range(PAIRS) if (link, world, number) not in have]
    begun = time.monotonic()
    simulated = in_simulation(skill, link, world, dict(zip(names, points[lacking].T, strict=True)), lacking)
    each_s = (time.monotonic() - begun) / max(1, len(lacking))
    for number, ours in zip(lacking, simulated, strict=True):
        truth = dict(zip(names, points[number].tolist(), strict=True))
        begun = time.monotonic()
        process, pipe = ready(link, world, truth, 1000 + number, Plan())
        back, there = FORK.Pipe(duplex=False)
        runner = FORK.Process(target=run_linked, args=(skill, link, world, pipe, there))
        runner.start()
        there.close()
        rehearsed = back.recv()
        runner.join()
        add(path, part="pair", link=link, world=world, number=number, truth=truth, simulated=ours, rehearsed=rehearsed,
            fake=ended(process, pipe), simulation_s=each_s, rehearsal_s=time.monotonic() - begun)  # fmt: skip


def in_simulation(
    skill: Path, link: str, world: str, draws: dict[str, Any], seeds: list[int]
) -> list[dict[str, Any]]:  # fmt: skip
    """The draws, in the simulation loop."""
    runnable, setup = prepare(load_robot_model(FAKES[link][2]), load_world(world, {}),
                              skillframe.LearnedSkill.load(skill).document, COC[world])  # fmt: skip
    found = simulate(runnable, setup, draws, [np.random.default_rng(each) for each in seeds],
                     duration_s=LONGEST_S[world])  # fmt: skip
    columns = {"success": found.success, "duration_s": found.duration_s, "peak_n": found.peak_force_n,
               "failure": found.failure, "reason": found.reason, "filtered_n": found.peak_force_filtered_n}  # fmt: skip
    return [{name: np.asarray(each).tolist()[i] for name, each in columns.items()} for i in range(len(seeds))]


def drawn(number: int, link: str) -> tuple[Plan, dict[str, float], list[str]]:
    """A random fault, the truth behind the fake, and words of the runner."""
    rng = np.random.default_rng([number, 5])
    kinds = [*STOPS, *SENSOR, "set", "wrong_press"]
    if link != "franka":
        kinds.remove("lost_commands")  # elsewhere commands do not come by UDP
    kind = kinds[rng.integers(len(kinds))]
    early = bool(rng.random() < 0.2)
    at = float(rng.uniform(0.0, 1.2 if early else 1.1 * RUN_S[link]))
    if kind == "set":
        name = list(SETTINGS)[rng.integers(len(SETTINGS))]
        return Plan(), {**TRUTH, name: float(rng.uniform(*SETTINGS[name]))}, []
    if kind == "wrong_press":
        wrong = str(rng.choice(["sign", "tool_axes", "at_tip"]))
        return Plan(wrong, SENSOR[wrong][0], 0.0, 0.0, True), TRUTH, ["--press"]
    value, lasts = (float(rng.uniform(*ranges.get(kind, (0.0, 0.0)))) for ranges in (SENSOR, LENGTHS))
    return Plan(kind, value, at, lasts, early), TRUTH, []


def faults(path: Path, link: str, count: int) -> None:
    """Run the faults that the file lacks."""
    skill = learned("valley", path.parent)
    have = {(each["link"], each["number"]) for each in kept(path) if each["part"] == "fault"}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored, also by children
    written = cell(path.parent, FAKES[link][2], link)
    written.write_text(written.read_text() + f'[believed]\n"fixture.offset_x" = {TRUTH["fixture.offset_x"]}\n')
    for number in range(count):
        if (link, number) in have:
            continue
        coc = ["--coc", "tip"] if link == "ros2" else []
        for _ in range(MOST_TRIES):
            plan, truth, words = drawn(number, link)
            *python, program = COMMAND
            patient = "" if plan.kind in LENGTHS or plan.kind == "cut" else PATIENT
            line = [
                *python,
                patient + program,
                "drive",
                "run",
                str(skill),
                "--cell",
                str(written),
                *coc,
                *words,
                "--duration",
                "4",
            ]
            process, pipe = ready(link, "valley", truth, number, plan)
            said = told(line, plan)
            found = ended(process, pipe)
            if found["fired"] is not None or "no state from" not in said["said"]:
                break  # else the busy machine kept the fake from running for 100 ms
        add(path, part="fault", link=link, number=number, kind=plan.kind or "set", words=words, truth=truth,
            value=plan.value, at=plan.at, lasts=plan.lasts, fake=found, **said)  # fmt: skip


def told(line: list[str], plan: Plan) -> dict[str, Any]:
    """What the runner printed, its exit code, the time from its verdict to its end [s], and processes that it left."""
    runner = subprocess.Popen(line, env=ENVIRONMENT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, start_new_session=True)  # fmt: skip
    plan.pid.value = runner.pid
    hanging = threading.Timer(300.0, runner.kill)
    hanging.start()
    assert runner.stdin is not None and runner.stdout is not None
    runner.stdin.write("move\n")
    runner.stdin.flush()
    said, verdict = "", None
    for text in runner.stdout:
        said += text.replace(ASKED, ASKED + "\n")
        if verdict is None and re.match("failure|success|error|interrupted", text.removeprefix(ASKED)):
            verdict = time.monotonic()
    code = runner.wait()
    late = None if verdict is None else time.monotonic() - verdict
    hung = not hanging.is_alive()
    hanging.cancel()
    time.sleep(0.5)
    return {"said": said, "code": code, "late_s": late, "hung": hung, "left": alive(runner.pid, line)}


def alive(session: int, line: list[str]) -> list[str]:
    """Command lines of processes of a session, and of publishers of this host."""
    found = []
    for each in Path("/proc").glob("[0-9]*"):
        try:
            words = (each / "cmdline").read_text().replace("\0", " ")
            in_session = int((each / "stat").read_text().rpartition(")")[2].split()[3]) == session
        except (OSError, ValueError):
            continue
        if in_session or f"skillframe_ros2.publisher {host()}" in words:
            found.append(words)
    return found


def complaints(run: dict[str, Any]) -> list[str]:
    """What is wrong with how a fault ended."""
    said, code, kind, fake = run["said"], run["code"], run["kind"], run["fake"]
    found = [text for text in ("Traceback", "internal error", "terminate called") if text in said]
    verdicts = re.findall(r"^(?:failure|error): .*|^success$|^interrupted.*", said, re.M)
    wanted = {0: "success", 1: "failure", 2: "error", 130: "interrupted"}
    fired = fake["fired"] is not None
    if fired and kind in ("killed", "terminated") and code in (-9, -15):
        verdicts = ["by a signal"]
    elif code not in wanted:
        found.append(f"exit code {code}")
    elif not any(each.startswith(wanted[code]) for each in verdicts):
        found.append(f"exit code {code} without a sentence")
    if run["hung"]:
        found.append("the runner hung")
    named = re.search(STOPS.get(kind, ""), " ".join(verdicts))
    if fired and code in (1, 2) and not named and not own(run):
        found.append("another cause is named")
    if run["late_s"] is not None and run["late_s"] > GONE_S:
        found.append(f"gone only after {run['late_s']:.1f} s")
    if fired and kind in STOPS and fake["moving_then"] and not own(run) and fake["halted_s"] > WITHIN_S + waiting(run):
        found.append(f"moved for {1e3 * fake['halted_s']:.0f} ms")
    return found + [f"left {each}" for each in run["left"]]


def waiting(run: dict[str, Any]) -> float:
    """For how long a fault lasts that does not stop the robot by itself [s]."""
    return run["lasts"] if run["kind"] in LENGTHS else 0.0


def own(run: dict[str, Any]) -> bool:
    """Whether the run ended in the skill's own verdict, or at a limit."""
    failure = re.search(r"^failure: (.*)", run["said"], re.M)
    return run["code"] == 0 or bool(failure and not re.match(OF_LINK, failure[1]))


def show(path: Path) -> None:
    """Print the figures."""
    runs = kept(path)
    for link, world in dict.fromkeys((each["link"], each["world"]) for each in runs if each["part"] == "pair"):
        told = [each for each in runs if each["part"] == "pair" and (each["link"], each["world"]) == (link, world)]

        def column(who: str, key: str, told: list[dict[str, Any]] = told) -> Any:
            return np.array([each[who][key] for each in told])

        ours, theirs = (int(column(who, "success").sum()) for who in ("simulated", "rehearsed"))
        interval = clopper_pearson(ours, len(told))
        ratio = np.abs(column("rehearsed", "duration_s") / column("simulated", "duration_s") - 1.0)
        peaks = np.abs(column("rehearsed", "peak_n") - column("simulated", "peak_n"))
        if all("filtered_n" in each["simulated"] for each in told):
            apart = np.abs(column("rehearsed", "filtered_n") - column("simulated", "filtered_n"))
            print(f"  peaks of the filtered estimate {np.median(apart):.2f} N apart in the median")
        same = int((column("simulated", "success") == column("rehearsed", "success")).sum())
        cost = [np.median([each[key] for each in told]) for key in ("rehearsal_s", "simulation_s")]
        print(f"{link} {world}: {len(told)} pairs, {theirs} successes, simulated {ours} (interval "
              f"{len(told) * interval.low:.1f} to {len(told) * interval.high:.1f}), the same in {same}; durations "
              f"apart {100.0 * np.median(ratio):.2f} % in the median, {100.0 * ratio.max():.1f} % at most; peaks "
              f"{np.median(peaks):.2f} N, {peaks.max():.1f} N at most; a run costs {cost[0]:.1f} s, simulated "
              f"{cost[1]:.1f} s (medians)")  # fmt: skip
    for link in dict.fromkeys(each["link"] for each in runs if each["part"] == "fault"):
        told = [each for each in runs if each["part"] == "fault" and each["link"] == link]
        survived = [each for each in told if own(each) or each["fake"]["fired"] is None]
        wrong = {each["number"]: text for each in told if (text := complaints(each))}
        stopped = [each["fake"] for each in told if each not in survived and each["kind"] in STOPS]
        moved = [each["halted_s"] for each in stopped if each["moving_then"]] or [0.0]
        late = [each["late_s"] for each in told if each["late_s"] is not None]
        print(f"{link}: {len(told)} faults, {len(survived)} survived, {len(wrong)} wrong; motion ended after "
              f"{1e3 * np.median(moved):.0f} ms, {1e3 * max(moved):.0f} ms at most; runner gone after "
              f"{np.median(late):.2f} s, {max(late):.2f} s at most")  # fmt: skip
        print("  " + ", ".join(f"{kind} {n}" for kind, n in sorted(Counter(each["kind"] for each in told).items())))
        for number, text in wrong.items():
            each = next(one for one in told if one["number"] == number)
            print(f"  {number} {each['kind']} at {each['at']:.2f} s, exit code {each['code']}: {'; '.join(text)}")


if __name__ == "__main__":
    what, file, *rest = sys.argv[1:]
    if what == "pairs":
        pairs(Path(file), *rest)
    elif what == "faults":
        faults(Path(file), rest[0], int(rest[1]))
    show(Path(file))
