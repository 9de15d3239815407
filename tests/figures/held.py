"""Runs held against a certified box: `python -m tests.figures.held [FOLDER [SET]]`.

The valley with the UR5e by positions: the fixture 15 mm to both sides and turned by 0.2 rad, friction 0.1 to 0.4, and
the start 25 mm higher. "Real" runs are simulated ones with fresh samples: 100 in that box, and 100 with a friction of
0.5. Each is held against 119 simulated runs of the box, with estimates by 60 of a wider one. FOLDER keeps the sets
that are done; SET makes only that one.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import skillframe
from skillframe.api.campaigns import Campaign
from skillframe.campaign import evaluate, folder
from skillframe.extend.registry import registry

FRICTION = "world.friction"
VARY = {"fixture.offset_x": (-0.015, 0.015), "fixture.tilt_y": (-0.2, 0.2), FRICTION: (0.1, 0.4)}
SETS = {"box": (119, 11), "wide": (60, 12), "same": (100, 13), "rubbed": (100, 14)}
"""Trials and seed of each set."""
DIVISIONS = 12
"""Of the box's 219 runs into 119 simulated and 100 real ones, since one division may be a lucky or an unlucky one."""


def campaign(place: Path):
    """The box, and its campaign in a folder."""
    from skillframe_drive.hold import Box

    skill = skillframe.learn(skillframe.record("valley", count=2, seed=3))
    plan = Campaign(
        world="valley", skills={"valley": skill}, robot="ur5e", trials=1, duration_s=8.0,
        set={"start.offset_z": 0.025},
        vary={name: {"uniform": list(ends)} for name, ends in VARY.items()},
    )  # fmt: skip
    spec = folder.prepare(plan.spec, place / "campaign", evaluate.describe, registry().world("valley").params)
    low, high = np.array(list(VARY.values())).T
    return Box(spec, tuple(VARY), low, high)


def made(name: str, place: Path):
    """Figures and quantities of a set, from its file or simulated."""
    from skillframe_drive.hold import simulate_box, wider

    path = place / f"{name}.npz"
    if not path.is_file():
        with tempfile.TemporaryDirectory() as other:
            box = campaign(Path(other))
            low, high = wider(box) if name == "wide" else (box.low.copy(), box.high.copy())
            if name == "rubbed":
                low[-1], high[-1] = 0.5, 0.5 + 1e-9
            found = simulate_box(box, low, high, *SETS[name], 1, print)
        np.savez(path, figures=found.figures, quantities=found.quantities)
    stored = np.load(path)
    return stored["figures"], stored["quantities"]


def main(place: Path) -> None:
    """Print the share that is called outside: with the sets as they are, and over divisions of the box's runs."""
    from skillframe_drive.envelope import Regression, held
    from skillframe_drive.figures import FRICTION as MU
    from skillframe_drive.hold import SETTINGS

    sets = {name: made(name, place) for name in SETS}
    low, high = np.array(list(VARY.values())).T
    regression, rubbed = Regression(*sets["wide"], (2, MU)), sets["rubbed"][0]

    def outside(box, runs):
        return np.array([held(box, each, low, high, regression).p <= SETTINGS.level for each in runs])

    for name in ("same", "rubbed"):
        seen, truth = sets[name]
        found, slid = outside(sets["box"][0], seen), np.isfinite(seen[:, MU])
        off = np.abs(seen[slid, MU] - truth[slid, -1])
        covered = np.abs(regression.estimate(seen) - truth) <= [regression.half_width(each) for each in seen]
        print(f"{name}: {found.sum()} of {len(seen)} outside; {found[slid].sum()} of {slid.sum()} that slid; "
              f"friction without a model off by {np.median(off):.3f} in the median and {np.quantile(off, 0.9):.3f} in "
              f"90 %; estimates cover in {np.round(100.0 * covered.mean(axis=0)).astype(int).tolist()} %")  # fmt: skip
    runs, rng, shares = np.vstack([sets["box"][0], sets["same"][0]]), np.random.default_rng(0), []
    for _ in range(DIVISIONS):
        order = rng.permutation(len(runs))
        box, real = runs[order[: SETS["box"][0]]], runs[order[SETS["box"][0] :]]
        shares.append((outside(box, real).mean(), outside(box, rubbed).mean()))
    for name, share in zip(("of the box", "with a friction of 0.5"), 100.0 * np.array(shares).T, strict=True):
        spread = f"{share.min():.0f} to {share.max():.0f}"
        print(f"over {DIVISIONS} divisions, of runs {name} are called outside {share.mean():.1f} % ({spread})")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        kept = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(temporary)
        if len(sys.argv) > 2:
            made(sys.argv[2], kept)
        else:
            main(kept)
