"""What a kinder simulation hides: three tasks on five robots, judged as the robots are, and as if nothing could break.

    python -m tests.figures.kinder FOLDER [BLOCKS] [ROBOT ...]

keeps every campaign in FOLDER, passes over those that are there, and prints the table of docs/evidence/data/kinder.csv.
BLOCKS of 8 gives 256 draws a cell; robots are named by how their names begin.

"As it is" is the robot as shipped, with the interface of `ROBOTS`: bodies collide, motors have efforts, speeds and
ranges, and the simulator's contact force is held to the limit. "Kinder" is the same arm as an ideal source of torque:
`[collisions] enabled = false`, a URDF without efforts and velocities, the simulator's force not looked at, so that only
the controller's estimate is held to the limit. So all arms were simulated at commit 4c3a7e9.
"""

from __future__ import annotations

import json
import shutil
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch
from xml.etree import ElementTree

import numpy as np
from scipy.stats import binomtest

from skillframe import Campaign, CampaignResults, LearnedSkill, learn, record
from skillframe.campaign import evaluate
from skillframe.campaign.folder import load
from skillframe.campaign.rows import ChunkJob, Row
from skillframe.campaign.runner import Options, run_campaign
from skillframe.control.contact import TrueContact
from skillframe.robot.spec import load_robot, robot_names

TRIALS, TEACHINGS, BLOCKS, SEED = 16, (1, 2), 8, 20261123
"""16 draws a block, eight blocks a teaching, two teachings: 256 a cell. A table can be looked at after each block."""
KINDER, LIMIT = "kinder", 80.0
"""Name of the other simulation; force limit of all five robots [N]."""
NEW = ("collision", "motor", "speed", "range", "true_force", "true_torque")
"""What ends a trial as the robot is and not in the kinder simulation, by `ended_by`. Of ranges both have the stops."""
ROBOTS = {
    "panda, torque": ("panda", ""),
    "fr3, torque": ("fr3", ""),
    "panda, velocity": ("panda", 'interface = "velocity"\ndelay_s = 0.003\nbandwidth_hz = 50.0\n'),
    "ur5e, position": ("ur5e_torque", 'interface = "position"\ndelay_s = 0.008\nbandwidth_hz = 10.0\n'),
    "kuka_iiwa14, position": ("kuka_iiwa14", 'interface = "position"\ndelay_s = 0.01\nbandwidth_hz = 15.0\n'),
}
RATES = {"ur5e, position": 500, "kuka_iiwa14, position": 200}
TASKS: dict[str, dict[str, Any]] = {
    "peg_in_hole": {
        "duration_s": 8.0,
        "set": {"start.offset_z": 0.002},
        "vary": {"fixture.offset_x": {"sobol": [-0.008, 0.008]}, "fixture.tilt_y": {"sobol": [-0.12, 0.12]}},
    },
    "valley": {
        "duration_s": 6.0,
        "set": {"start.offset_z": 0.05, "world.friction": 0.5},
        "vary": {"fixture.offset_x": {"sobol": [-0.015, 0.015]}, "fixture.tilt_y": {"sobol": [-0.45, 0.45]}},
    },
    "hose_coupler": {
        "duration_s": 10.0,
        "set": {"start.offset_z": 0.02},
        "vary": {
            "start.tilt_y": {"sobol": [-0.14, 0.14]},
            "fixture.offset_z": {"sobol": [-0.01, 0.01]},
            "fixture.tilt_y": {"sobol": [-0.07, 0.07]},
        },
    },
}


def made(folder: Path, robot: str, kinder: bool) -> Path:
    """A robot's folder: the shipped one with its interface, or as an ideal source of torque whom nothing stops."""
    name, interface = ROBOTS[robot]
    out = folder / "robots" / (f"{name}_{KINDER}" if kinder else robot.replace(", ", "_"))
    if out.exists():
        return out
    shutil.copytree(robot_names()[name], out)
    text = (out / "robot.toml").read_text(encoding="utf-8").replace('"../ur5e/', '"')
    shutil.copy(load_robot(name).urdf, out)
    if kinder:
        text += "\n[collisions]\nenabled = false\n"
        _without_motors(out / load_robot(name).urdf.name)
    else:
        text = text.replace("rate_hz = 1000\n", f"rate_hz = {RATES.get(robot, 1000)}\n{interface}", 1)
    (out / "robot.toml").write_text(text, encoding="utf-8")
    return out


def _without_motors(urdf: Path) -> None:
    tree = ElementTree.parse(urdf)
    for limit in tree.iter("limit"):
        limit.set("effort", "0")
        limit.set("velocity", "0")
    tree.write(urdf)


@contextmanager
def the_estimate_alone() -> Iterator[None]:
    """Within this, the simulator's force ends no trial. It is still taken in."""
    look = TrueContact.look

    def taken_in(self: TrueContact, rows: Any) -> list[Any]:
        look(self, rows)
        return []

    with patch.object(TrueContact, "look", taken_in):
        yield


def taught(folder: Path, name: str, task: str, teaching: int) -> dict[str, LearnedSkill]:
    """What is learned on a robot from two demonstrations, which its interface has no part in, by LMC and replay."""
    where = folder / "skills" / f"{name}-{task}-{teaching}"
    files = {kind: where / f"{kind}.skill.json" for kind in ("lmc", "replay")}
    if not all(file.exists() for file in files.values()):
        where.mkdir(parents=True, exist_ok=True)
        demonstrations = record(task, name, count=2, seed=teaching).demonstrations
        learn(demonstrations, "lmc").save(files["lmc"])
        learn(demonstrations[:1], "replay", mode="absolute").save(files["replay"])
    return {kind: LearnedSkill.load(file) for kind, file in files.items()}


def campaign(folder: Path, robot: str, task: str, teaching: int, block: int) -> CampaignResults:
    """A sixteenth of one cell as the robot is: 16 draws, the same for both skills and all robots."""
    out = folder / robot.replace(", ", "-") / f"{task}-{teaching}-{block}"
    if not (out / "summary.json").exists():
        shutil.rmtree(out, ignore_errors=True)
        _plan(folder, robot, task, teaching, block, made(folder, robot, kinder=False)).prepare(out)
        run_campaign(out, evaluate.evaluate, Options(traces=0))
    return CampaignResults(out)


def _plan(folder: Path, robot: str, task: str, teaching: int, block: int, arm: Path) -> Campaign:
    skills = taught(folder, ROBOTS[robot][0], task, teaching)
    return Campaign(
        world=task, robot=arm, skills=skills, trials=TRIALS, seed=SEED + 10 * block + teaching, coc="tip",
        name=f"{task}, {robot}, teaching {teaching}, block {block}", **TASKS[task],
    )  # fmt: skip


def kinder_rows(folder: Path, robot: str, task: str, teaching: int, block: int) -> list[Row]:
    """The rows of the same draws, judged kindly.

    Of an arm that takes torques, a trial that no new rule ended and that asked no motor for more than it has is the
    same to the last bit, and is not simulated again.
    """
    out = folder / f"{ROBOTS[robot][0]}-{KINDER}" / f"{task}-{teaching}-{block}"
    if not (rows := out / "kinder.json").exists():
        known = [] if ROBOTS[robot][1] else _unharmed(campaign(folder, robot, task, teaching, block).rows)
        shutil.rmtree(out, ignore_errors=True)
        _plan(folder, robot, task, teaching, block, made(folder, robot, kinder=True)).prepare(out)
        rows.write_text(json.dumps([*known, *_simulated(out, known)]), encoding="utf-8")
    found: list[Row] = json.loads(rows.read_text(encoding="utf-8"))
    return found


def _unharmed(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row["ended_by"] not in NEW and not float(row["peak_torque_share"]) > 1.0]


def _simulated(folder: Path, known: list[Row]) -> list[Row]:
    """Of a prepared campaign every row that is not known yet."""
    spec = load(folder)
    found: list[Row] = []
    for index, label in enumerate(spec.labels):
        trials = set(range(spec.trials)) - {row["trial"] for row in known if row["skill"] == label}
        if trials:
            job = ChunkJob(spec=spec.plain(), folder=str(folder), skill=index, trials=tuple(sorted(trials)))
            with the_estimate_alone():
                found += evaluate.evaluate(job)
    return found


Key = tuple[int, int, int]
"""Of a trial: teaching, block, number."""


def found(folder: Path, blocks: int, robot: str, task: str, skill: str) -> tuple[dict[Key, Row], dict[Key, Row]]:
    """The rows that a folder has of one skill in the first blocks, as the robot is and in the kinder simulation."""
    true: dict[Key, Row] = {}
    kind: dict[Key, Row] = {}
    for teaching, block in product(TEACHINGS, range(blocks)):
        place = f"{task}-{teaching}-{block}"
        files = f"{ROBOTS[robot][0]}-{KINDER}/{place}/kinder.json", f"{robot.replace(', ', '-')}/{place}/summary.json"
        if not all((folder / file).exists() for file in files):
            continue
        rows = campaign(folder, robot, task, teaching, block).rows, kinder_rows(folder, robot, task, teaching, block)
        for into, some in zip((true, kind), rows, strict=True):
            into |= {(teaching, block, row["trial"]): row for row in some if row["skill"].startswith(skill)}
    return true, kind


def rate(rows: dict[Key, Row]) -> str:
    """Successes, with the exact 95 % interval, and those of each teaching."""
    wins, count = sum(bool(row["success"]) for row in rows.values()), len(rows)
    low, high = binomtest(wins, count).proportion_ci(method="exact")
    each = (sum(bool(row["success"]) for key, row in rows.items() if key[0] == t) for t in TEACHINGS)
    return f"{wins} of {count} ({'+'.join(map(str, each))}), {low:.2f} to {high:.2f}"


def reasons(rows: Iterable[Row]) -> str:
    """What ended some trials, the most frequent first."""
    counts = Counter(row["ended_by"] if row["ended_by"] != "skill" else "goal missed" for row in rows)
    return ", ".join(f"{number} {name}" for name, number in counts.most_common()) or "-"


def line(folder: Path, blocks: int, robot: str, task: str, skill: str) -> str:
    """One line of the table."""
    true, kind = found(folder, blocks, robot, task, skill)
    if not true:
        return ""
    lost = [true[key] for key in true if kind[key]["success"] and not true[key]["success"]]
    gained = [key for key in true if true[key]["success"] and not kind[key]["success"]]
    peaks = [row["peak_force_n"] for row in true.values() if row["success"]]
    marked = f"{sum(peak > LIMIT for peak in peaks)} of {len(peaks)}"
    durations = [[row["duration_s"] for row in rows.values() if row["success"]] for rows in (kind, true)]
    pushed = [np.median([row["peak_force_n"] for row in rows.values()]) for rows in (kind, true)]
    slow = " -> ".join(f"{np.median(each):.1f}" if each else "-" for each in durations)
    hard = " -> ".join(f"{each:.0f}" for each in pushed)
    cells = (task, robot, skill, rate(kind), rate(true), reasons(lost), str(len(gained)), slow, hard, marked)
    return f"| {' | '.join(cells)} |"


def table(folder: Path, blocks: int) -> None:
    """Print what is there of the first blocks."""
    head = ("task", "robot", "skill", "kinder", "as it is", "lost, by what ended them", "won", "seconds", "peak [N]")
    print(f"| {' | '.join(head)} | over {LIMIT:g} N |")
    print("|---" * (len(head) + 1) + "|")
    for task, robot, skill in product(TASKS, ROBOTS, ("lmc", "replay")):
        if text := line(folder, blocks, robot, task, skill):
            print(text)


def main(folder: Path, blocks: int, robots: Sequence[str]) -> None:
    """Run what is missing, and print the table."""
    for block, teaching, task, robot in product(range(blocks), TEACHINGS, TASKS, robots):
        began = time.process_time()
        campaign(folder, robot, task, teaching, block)
        kinder_rows(folder, robot, task, teaching, block)
        spent = time.process_time() - began
        if spent > 1.0:
            print(f"{task}, {robot}, teaching {teaching}, block {block}: {spent:.0f} s of CPU", file=sys.stderr)
    table(folder, blocks)


if __name__ == "__main__":
    many = int(sys.argv[2]) if len(sys.argv) > 2 else BLOCKS
    main(Path(sys.argv[1]), many, [name for name in ROBOTS if name.startswith(tuple(sys.argv[3:] or [""]))])
