"""A real run held against the simulation of its certificate's box.

`reference` simulates the certificate's own campaign anew: N trials over the box that was certified, and N over a box of
twice its width, for the estimates. `compare` judges a run by them (`envelope`). A folder keeps the result:

    hold.json    what was found, and the figures of all runs
    traces/      the run, and the simulated runs that are most like it; `skillframe report FOLDER` shows them
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.campaign import (
    TRACE,
    Axis,
    CampaignSpec,
    ChunkJob,
    Expect,
    Stop,
    campaign_hash,
    combined_hash,
    evaluate,
    is_trial,
    load,
    to_lines,
)
from skillframe.config.units import shown
from skillframe.document import load_skill
from skillframe.errors import InputError
from skillframe.execution import Trace, load_world
from skillframe.extend import quantities
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import Float
from skillframe_drive.envelope import Regression, Verdict, held
from skillframe_drive.figures import FRICTION, NAMES, figures
from skillframe_drive.section import HOLD


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldSettings:
    """How a run is held.

    Attributes:
        level: probability that a run of the box is called outside, at most.
        least: fewest simulated runs with which p can be the level: 2 / (N + 1). 79, 119, ... use it fully.
        chunk: trials that are simulated together, between two reports of progress.
        nearest: simulated runs that are kept beside the real one.
    """

    level: float = 0.05
    least: int = 39
    chunk: int = 25
    nearest: int = 3


SETTINGS = HoldSettings()


class Box(NamedTuple):
    """What was certified: its campaign, and the ends (Q,) of the box in SI by its quantities' names."""

    spec: CampaignSpec
    names: tuple[str, ...]
    low: Float
    high: Float


class Simulated(NamedTuple):
    """Simulated runs: figures (N, F), quantities (N, Q), and traces (N,)."""

    figures: Float
    quantities: Float
    traces: list[Trace]


class Estimate(NamedTuple):
    """A quantity as estimated from a run, with the half width of 90 % of estimates, and the certified range."""

    name: str
    value: float
    half_width: float
    low: float
    high: float

    @property
    def covered(self) -> bool:
        """Whether the certified range holds a value within the half width of the estimate."""
        return self.low - self.half_width <= self.value <= self.high + self.half_width

    def covering(self) -> tuple[float, float]:
        """The certified range, widened by the estimate's where it is not covered."""
        if self.covered:
            return self.low, self.high
        step = 10.0 ** math.floor(math.log10(self.high - self.low) - 1.0)
        low = min(self.low, math.floor((self.value - self.half_width) / step + 1e-9) * step)
        high = max(self.high, math.ceil((self.value + self.half_width) / step - 1e-9) * step)
        limits = getattr(quantities().get(self.name), "range", None)
        if limits is not None:
            low, high = max(low, limits.least), min(high, limits.most)
        return float(f"{low:.6g}"), float(f"{high:.6g}")


class Held(NamedTuple):
    """A run held against the simulation: its figures (F,), the verdict, estimates, and figures beyond all simulated."""

    figures: Float
    verdict: Verdict
    estimates: list[Estimate]
    odd: list[int]

    @property
    def outside(self) -> bool:
        """Whether the run is called outside what was certified."""
        return self.verdict.p <= SETTINGS.level


def read_box(folder: Path) -> Box:
    """The box that a certificate certifies.

    Raises:
        InputError: there is no certificate, it certifies nothing, or its campaign was changed.
    """
    folder = folder.parent if folder.name == "certificate.json" else folder
    again = "give the folder that skillframe certify run has written"
    path = folder / "certificate.json"
    if not path.is_file():
        raise InputError(folder, "holds no certificate", again)
    content = read_json(path, again)
    predicate = content.get("predicate") if isinstance(content, dict) else None
    if not isinstance(predicate, dict) or "certified" not in predicate:
        raise InputError(path, "is no certificate", again)
    if not predicate["certified"]:
        raise InputError(path, "certifies no box, so that no run can lie in it", "certify first")
    if not isinstance(predicate.get("claim"), int) or not {"campaign", "box"} <= set(predicate):
        raise InputError(path, "was made by an earlier skillframe, or is damaged", "make it again: certify run")
    spec = load(folder / f"claim{predicate['claim']}" / "fresh")
    if campaign_hash(spec) != predicate["campaign"]:
        raise InputError(spec.folder, "was changed after the certificate", f"type skillframe certify check {folder}")
    names = tuple(predicate["box"])
    low, high = np.array([predicate["box"][name] for name in names], dtype=float).T
    return Box(spec, names, low, high)


def wider(box: Box) -> tuple[Float, Float]:
    """Ends of a box of twice the width, as far as the quantities' ranges go."""
    half = 0.5 * (box.high - box.low)
    ends = box.low - half, box.high + half
    known = quantities()
    for i, name in enumerate(box.names):
        limits = known[name].range if name in known else None
        if limits is not None:
            ends[0][i], ends[1][i] = max(ends[0][i], limits.least), min(ends[1][i], limits.most)
        elif not _builds(box.spec, name, (float(ends[0][i]), float(ends[1][i]))):
            ends[0][i], ends[1][i] = box.low[i], box.high[i]
    return ends


def _builds(spec: CampaignSpec, name: str, values: Sequence[float]) -> bool:
    """Whether the world can be built with each value of its parameter."""
    fixed = {k.removeprefix("world."): v for k, v in spec.fixed.items() if k.startswith("world.")}
    try:
        for value in values:
            load_world(spec.world_place, {**fixed, name.removeprefix("world."): value})
    except InputError:
        return False
    return True


def simulate_box(
    box: Box, low: Float, high: Float, count: int, seed: int, workers: int, say: Callable[[str], None]
) -> Simulated:
    """Simulate trials with the box's quantities uniform between ends, and the certificate's other axes.

    Starts in penetration are no trials and are left out.

    Args:
        box: the certificate's.
        low: (Q,) lower ends.
        high: (Q,) upper ends.
        count: number of trials.
        seed: of all samples.
        workers: processes.
        say: takes messages on progress.

    Raises:
        InputError: too few trials are usable.
    """
    axes = {name: Axis(kind="uniform", numbers=(low[i], high[i])) for i, name in enumerate(box.names)}
    spec = replace(
        box.spec, vary={**box.spec.vary, **axes}, trials=count, seed=seed, stop=Stop(), race=None, expect=Expect(),
        scores=(),
    )  # fmt: skip
    found: list[tuple[Float, list[float], Trace]] = []
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "trace.npz"
        chunk = SETTINGS.chunk
        chunks = [tuple(range(first, min(first + chunk, count))) for first in range(0, count, chunk)]
        jobs = [ChunkJob(spec=spec.plain(), folder=str(spec.folder), skill=0, trials=t, traces=True) for t in chunks]
        done = 0
        pool = ProcessPoolExecutor(workers, get_context("spawn")) if workers > 1 else None
        with pool or nullcontext():
            for rows in (pool.map if pool else map)(evaluate.evaluate, jobs):
                for row in rows:
                    if is_trial(row):
                        path.write_bytes(row[TRACE])
                        trace = Trace.load(path)
                        found.append((figures(trace), [float(row[name]) for name in box.names], trace))
                done += len(rows)
                say(f"{done} of {count} trials simulated")
    if len(found) < SETTINGS.least:
        text = f"of {count} simulated trials {len(found)} are usable, and {SETTINGS.least} are needed"
        raise InputError(box.spec.folder, text, "give a larger --trials")
    seen, drawn, traces = zip(*found, strict=True)
    return Simulated(np.array(seen), np.array(drawn), list(traces))


def read_runs(paths: Sequence[Path], box: Box) -> dict[str, Trace]:
    """Runs by name.

    Raises:
        InputError: two have one name, or a run is of another skill, slowed, dry, or of too few samples.
    """
    runs: dict[str, Trace] = {}
    skill = combined_hash(load_skill(box.spec.skills[0], box.spec.folder)[1])
    for path in paths:
        if path.stem in runs:
            raise InputError(path, "has the name of another run", "rename one of them")
        run = runs[path.stem] = Trace.load(path)
        if run.meta.get("skill_sha256", skill) != skill:
            raise InputError(path, "was run with another skill than was certified", "give its own certificate")
        if run.meta.get("slow", 1.0) != 1.0 or run.meta.get("dry"):
            raise InputError(path, "was a slowed or a dry run", "run it at full speed: leave out --slow and --dry")
        if len(run.time) < 3 or float(np.median(np.diff(run.time))) > 0.02:
            raise InputError(path, "has fewer than 50 samples a second", "record it with drive run")
    return runs


def refuse_other(run: Trace, simulated: Trace, where: object) -> None:
    """Refuse a run on another robot or in another world than a simulated one.

    Raises:
        InputError: says what differs.
    """
    told = {
        "robot": "robot", "world": "world", "interface": "control interface",
        "center_of_compliance": "centre of compliance",
    }  # fmt: skip
    for key, name in told.items():
        if run.meta.get(key, simulated.meta[key]) != simulated.meta[key]:
            raise InputError(where, f"was run with another {name} than was certified", "give its own certificate")


def compare(run: Trace, box: Box, reference: Simulated, wide: Simulated) -> Held:
    """Judge a run by simulated ones of the box, and estimate its quantities from those of the wider box."""
    rubs = box.names.index("world.friction") if "world.friction" in box.names else None
    regression = Regression(wide.figures, wide.quantities, None if rubs is None else (rubs, FRICTION))
    own = figures(run)
    values, widths = regression.estimate(own[None])[0], regression.half_width(own)
    estimates = [Estimate(*each) for each in zip(box.names, values, widths, box.low, box.high, strict=True)]
    verdict = held(reference.figures, own, box.low, box.high, regression)
    low, high = np.fmin.reduce(reference.figures), np.fmax.reduce(reference.figures)  # NaN only where all are
    odd = np.flatnonzero((own < low) | (own > high) | (np.isnan(own) != np.isnan(reference.figures).all(axis=0)))
    return Held(own, verdict, estimates, [int(i) for i in odd])


def said(found: Held) -> list[str]:
    """What was found, a sentence each, and the lines of campaign.toml that would cover the run."""
    verdict = found.verdict
    place = "outside what was certified" if found.outside else "like the simulated runs of the certificate"
    lines = [f"{place} (p = {verdict.p:.3f}; in the box's quantities {verdict.p_box:.3f}, in any figure "
             f"{verdict.p_any:.3f})"]  # fmt: skip
    if np.isfinite(found.figures[FRICTION]):
        lines.append(f"friction without a model {found.figures[FRICTION]:.2f}")
    known = quantities()
    for each in found.estimates:
        unit = known[each.name].unit if each.name in known else ""
        value, half, low, high = (shown(float(f"{v:.3g}"), unit) for v in each[1:])
        lines.append(f"{each.name} {value} +- {half}, certified from {low} to {high}"
                     + ("" if each.covered else ": NOT COVERED"))  # fmt: skip
    if found.outside and all(each.covered for each in found.estimates):
        names = ", ".join(NAMES[i] for i in found.odd) or "no single figure"
        lines.append(f"none of the box's quantities explains it; beyond all simulated runs: {names}")
    if cover := covering(found):
        lines += ["to cover it, write into campaign.toml and certify anew:", "[vary]", *to_lines(cover).splitlines()]
    return lines


def covering(found: Held) -> dict[str, Any]:
    """Axes of campaign.toml, by quantity, that would cover a run, for the quantities that the certificate does not."""
    return {each.name: {"uniform": list(each.covering())} for each in found.estimates if not each.covered}


def refuse_used(folder: Path) -> None:
    """Refuse a folder that holds something. Raises `InputError`."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "exists and is not an empty folder", "choose another --out")


def write_folder(folder: Path, runs: dict[str, tuple[Trace, Held]], box: Box, reference: Simulated) -> None:
    """Write the result of each run by its name, and the traces to look at."""
    (folder / "traces").mkdir(parents=True, exist_ok=True)
    told, kept = [], set()
    for name, (trace, found) in runs.items():
        trace.save(folder / "traces" / f"real_{name}.npz")
        order = np.argsort(_distance(reference.figures, found.figures))
        kept |= set(order[: SETTINGS.nearest].tolist())
        told.append({
            "run": name, "outside": found.outside, **found.verdict._asdict(), "p": found.verdict.p,
            "figures": _plain(found.figures), "estimates": [each._asdict() for each in found.estimates],
            "odd": [NAMES[i] for i in found.odd], "said": said(found), "vary": covering(found),
        })  # fmt: skip
    for i in sorted(kept):
        reference.traces[i].save(folder / "traces" / f"simulated_{i:03d}.npz")
    content = {
        "format": "skillframe.hold", "version": 1, "campaign": campaign_hash(box.spec), "names": list(NAMES),
        "runs": told, "simulated": [_plain(row) for row in reference.figures],
    }  # fmt: skip
    write_whole(folder / HOLD, json.dumps(content, allow_nan=False).encode())


def _plain(row: Float) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in row]


def _distance(reference: Float, own: Float) -> Float:
    """Distance (N,) of runs from one, in widths of their figures' ranges."""
    width = np.fmax.reduce(reference) - np.fmin.reduce(reference)
    apart = (reference - own) / np.where(width > 0.0, width, 1.0)
    result: Float = np.nan_to_num(apart**2, nan=1.0).sum(axis=1)
    return result
