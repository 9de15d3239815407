"""A skill's border, boxes and breaking point by the campaign's commands, beside Sobol, grid and random trials.

    python -m tests.figures.searched peg --out FOLDER
    python -m tests.figures.searched valley --out FOLDER --seeds 10

Each step is a command, timed in processor seconds, and kept: the same line goes on where it was ended. Beside: as many
trials as the border took, by Sobol points, a grid and at random. From each the same surrogate predicts 512 fresh
random trials. What breaks the skill is the nearest failure to what is nominal, of the ranges' half widths. With
`--seeds` the border alone is looked for so many times, beside as many Sobol sequences, and what is told is from how
many trials on the surrogate stays within 5 % of the true set. With `--again 4` each fresh place is run so many times
more, with fresh noise, and counts as what most of its trials are: how many end otherwise is what noise decides.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from skillframe_certify.surrogate import Surrogate

from skillframe.cli.main import run

HELD_OUT = 512
SEQUENCE = 768
"""Sobol points beside each border."""
CLOSE = 0.05


Tried = tuple[np.ndarray, np.ndarray]
"""Points (n, d), each range from -1 to 1, and success (n,)."""


class Asked(NamedTuple):
    """A world, how its skill is run, its ranges with what is nominal in them, who is taught, and what is run.

    `held_out` is the number of fresh random trials, `beside` are the other ways to choose trials, `rates` those that
    are certified.
    """

    world: str
    setting: str
    duration_s: float
    ranges: dict[str, tuple[float, float]]
    nominal: tuple[float, ...]
    robot: str = "panda"
    teacher: str = "kinesthetic"
    held_out: int = HELD_OUT
    beside: tuple[str, ...] = ("Sobol", "random", "grid")
    rates: tuple[float, ...] = (0.95, 0.99)


ASKED = {
    "peg": Asked("peg_in_hole", 'coc = "tip"', 10.0, {
        "start.tilt_x": (-0.16, 0.16), "start.tilt_y": (-0.16, 0.16), "world.friction": (0.05, 0.5),
    }, (0.0, 0.0, 0.1)),
    "valley": Asked("valley", 'set = { "start.offset_z" = 0.12 }', 15.0, {  # above the steepest flank
        "fixture.offset_x": (-0.03, 0.06), "fixture.tilt_y": (-0.9, 0.9),
    }, (0.0, 0.0)),
    "coupler": Asked("hose_coupler", 'coc = "tip"', 10.0, {
        "start.tilt_x": (-0.12, 0.12), "world.friction": (0.05, 0.8),
    }, (0.0, 0.2)),
    "corner": Asked("corner", 'coc = "tip"', 10.0, {
        "fixture.tilt_z": (-0.12, 0.12), "world.friction": (0.05, 0.6),
    }, (0.0, 0.2)),
    "crane": Asked("pallets", "", 30.0, {
        "robot.payload": (0.0, 475.0), "actuator.delay": (0.0, 0.08),
    }, (475.0, 0.02), "hiab_xs031", "teleoperation", 256, ("Sobol",), (0.95,)),
}  # fmt: skip


def taught(asked: Asked, folder: Path) -> None:
    """Two demonstrations of a simulated person, and the skill learned from them."""
    demonstration = ["record", "--world", asked.world, "--count", "2", "--seed", "1"]
    demonstration += ["--robot", asked.robot, "--teacher", asked.teacher]
    assert run([*demonstration, "--out", str(folder / "d.npz")]) == 0
    shown = [str(folder / f"d{i}.npz") for i in (1, 2)]
    assert run(["learn", *shown, "--out", str(folder / "learned.skill.json")]) == 0


def campaign(
    asked: Asked, folder: Path, name: str, trials: int, seed: int, axis: Callable[[float, float], str]
) -> Path:
    """A campaign file over the ranges, each an axis in the words of `axis`."""
    lines = [f'"{key}" = {axis(low, high)}' for key, (low, high) in asked.ranges.items()]
    head = f'world = "{asked.world}"\nrobot = "{asked.robot}"\nskills = ["learned.skill.json"]'
    head += f"\ntrials = {trials}\nseed = {seed}"
    path = folder / f"{name}.toml"
    path.write_text(f"{head}\n{asked.setting}\nduration_s = {asked.duration_s}\n[vary]\n" + "\n".join(lines) + "\n")
    return path


def uniform(low: float, high: float) -> str:
    return f"{{ uniform = [{low}, {high}] }}"


def sobol(low: float, high: float) -> str:
    return f"{{ sobol = [{low}, {high}] }}"


def rows_of(asked: Asked, *tables: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, d), each range from -1 to 1, and success (n,)."""
    rows = [row for table in tables for row in csv.DictReader(table.read_text().splitlines())]
    low, high = np.array(list(asked.ranges.values())).T
    points = np.array([[float(row[key]) for key in asked.ranges] for row in rows])
    return 2.0 * (points - low) / (high - low) - 1.0, np.array([row["success"] == "1" for row in rows])


def timed(folder: Path, name: str, command: Sequence[str]) -> float:
    """Processor seconds of a command, run once and kept."""
    kept = folder / f"{name}.seconds"
    if not kept.exists():
        began = time.process_time()
        assert run(command) in (0, 1), command
        kept.write_text(f"{time.process_time() - began:.1f}")
    return float(kept.read_text())


def told(name: str, *figures: object) -> None:
    print("| " + " | ".join(map(str, (name, *figures))) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("task", choices=ASKED)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--again", type=int, default=0)
    chosen = parser.parse_args()
    asked, folder = ASKED[chosen.task], chosen.out
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "learned.skill.json").exists():
        taught(asked, folder)
    path = campaign(asked, folder, "fresh", asked.held_out, 77, uniform)
    seconds = timed(folder, "fresh", ["campaign", "run", str(path), "--out", str(folder / "fresh"), "--traces", "0"])
    points, works = rows_of(asked, folder / "fresh" / "results.csv")
    told("fresh, at random", asked.held_out, f"{works.mean():.3f} succeed", f"{seconds:.0f} s")
    if chosen.again:
        works = most(asked, folder, works, chosen.again)
    if chosen.seeds:
        return repeated(asked, folder, (points, works), range(100, 100 + chosen.seeds))

    border = folder / "border"
    go_on = (
        [str(border)]
        if border.exists()
        else [str(campaign(asked, folder, "border", 1, 9, uniform)), "--out", str(border)]
    )
    seconds = timed(folder, "map", ["certify", "map", *go_on])
    seen = rows_of(asked, border / "look" / "results.csv", *sorted(border.glob("border/*/results.csv")))
    count = len(seen[1])
    nominal = rows_nominal(asked)
    predicted("certify map", seen, (points, works), nominal, seconds)
    beside = {"Sobol": (count, sobol), "random": (count, uniform)}
    side = round(count ** (1.0 / len(asked.ranges)))
    beside["grid"] = (side ** len(asked.ranges), lambda low, high: grid(low, high, side))
    for name, (trials, axis) in ((name, beside[name]) for name in asked.beside):
        path = campaign(asked, folder, name.lower(), trials, 5, axis)
        out = folder / name.lower()
        seconds = timed(folder, name.lower(), ["campaign", "run", str(path), "--out", str(out), "--traces", "0"])
        predicted(name, rows_of(asked, out / "results.csv"), (points, works), nominal, seconds)

    for rate in asked.rates:
        claim = folder / f"claim{rate}"
        if not claim.exists():
            shutil.copytree(border, claim)
        seconds = timed(folder, claim.name, ["certify", "run", str(claim), "--rate", str(rate)])
        found = json.loads((claim / "certificate.json").read_text())["predicate"]
        told(f"certify {rate}", found["certified"], found.get("box"), f"{seconds:.0f} s")
    seconds = timed(folder, "break", ["certify", "find-failure", str(border)])
    told("break", (border / "breaking.json").read_text(), f"{seconds:.0f} s")


def most(asked: Asked, folder: Path, works: np.ndarray, again: int) -> np.ndarray:
    """What most trials (n,) of each fresh place are, the first and `again` others, an even number."""
    rows = list(csv.DictReader((folder / "fresh" / "results.csv").read_text().splitlines()))
    ended = [works]
    for i in range(again):
        out, listed = folder / f"fresh_again{i}", iter(asked.ranges)
        path = campaign(asked, folder, out.name, len(rows), 78 + i, lambda *_, left=listed: same(rows, next(left)))
        timed(folder, out.name, ["campaign", "run", str(path), "--out", str(out), "--traces", "0"])
        ended.append(rows_of(asked, out / "results.csv")[1])
    found = np.mean(ended, axis=0) > 0.5
    told(
        "trials that end otherwise than the first",
        int((np.array(ended[1:]) != works).sum()),
        f"of {again * len(works)}",
    )
    told("places whose first trial is not as most are", int((found != works).sum()))
    return found


def same(rows: list[dict[str, str]], key: str) -> str:
    return f"{{ values = [{', '.join(row[key] for row in rows)}] }}"


def repeated(asked: Asked, folder: Path, fresh: Tried, seeds: range) -> None:
    """The border by so many seeds, each beside a Sobol sequence of its own."""
    for seed in seeds:
        out, beside = folder / f"border{seed}", folder / f"sobol{seed}"
        path = campaign(asked, folder, out.name, 1, seed, uniform)
        timed(folder, out.name, ["certify", "map", *([str(out)] if out.exists() else [str(path), "--out", str(out)])])
        rounds = sorted(out.glob("border/*/results.csv"), key=lambda table: int(table.parent.name))
        seen = rows_of(asked, out / "look" / "results.csv", *rounds)
        path = campaign(asked, folder, beside.name, SEQUENCE, seed, sobol)
        timed(folder, beside.name, ["campaign", "run", str(path), "--out", str(beside), "--traces", "0"])
        found = [stays(tried, fresh) for tried in (seen, rows_of(asked, beside / "results.csv"))]
        told(
            f"seed {seed}",
            *(
                f"within 5 % from {first}, {early:.3f} after 256, {last:.3f} after {count}"
                for first, early, last, count in found
            ),
        )


def stays(seen: Tried, fresh: Tried) -> tuple[float, float, float, int]:
    """Trials from which on the error stays within `CLOSE`, the error after 256 and after all, and how many that is."""
    (points, works), (there, truth) = seen, fresh
    counts = range(128, len(works) + 1, 32)
    wrong = [
        float((((Surrogate(points[:n], works[:n]).mean(there)) > 0.0) != truth).sum() / truth.sum()) for n in counts
    ]
    late = [n for n, share in zip(counts, wrong, strict=True) if share > CLOSE]
    first = counts[0] if not late else late[-1] + 32
    early = wrong[min(counts.index(256) if 256 in counts else len(wrong), len(wrong) - 1)]
    return (first if first <= counts[-1] else np.inf), early, wrong[-1], counts[-1]


def grid(low: float, high: float, count: int) -> str:
    return f"{{ grid = {{ from = {low}, to = {high}, count = {count} }} }}"


def rows_nominal(asked: Asked) -> np.ndarray:
    low, high = np.array(list(asked.ranges.values())).T
    found: np.ndarray = 2.0 * (np.array(asked.nominal) - low) / (high - low) - 1.0
    return found


def predicted(
    name: str,
    seen: Tried,
    fresh: Tried,
    nominal: np.ndarray,
    cpu: float,
) -> None:
    """How many fresh trials the surrogate of some trials gets wrong, and the nearest failure to what is nominal."""
    (points, works), (there, truth) = seen, fresh
    wrong = int(((Surrogate(points, works).mean(there) > 0.0) != truth).sum())
    lost = np.linalg.norm(points[~works] - nominal, axis=1)
    told(
        name,
        len(works),
        f"{wrong} of {len(truth)} wrong",
        f"nearest failure {lost.min(initial=np.inf):.3f}",
        f"{cpu:.0f} s",
    )


if __name__ == "__main__":
    main()
