"""Which first-party plug-in a name ships in, so that a missing one can be named with the line that installs it."""

from __future__ import annotations

from collections.abc import Collection

from skillframe.paths import checkout

HOMES = {
    "skill:lmc": "lmc",
    "skill:policy": "segmenter",
    **{f"segmenter:{name}": "segmenter" for name in ("wrench_hmm", "pose_hmm", "zvc")},
    **{f"skill:{name}": "search" for name in ("search", "spiral", "random_walk", "seat")},
    **{f"skill:{name}": "baselines" for name in ("acp", "replay", "dmp", "gmr", "seds")},
    "coordinator:dual_arm": "dualarm",
    "skill:dual_arm": "dualarm",  # asked for as any other behaviour
    "world:dual_peg": "dualarm",
    **{f"row:{number}": "papers" for number in range(1, 45)},
    "command:reproduce": "papers",
    "command:benchmark": "benchmarks",
    **{f"score:automate_{name}": "benchmarks" for name in ("distance", "height")},
    **{f"score:{name}": "benchmarks" for name in ("insertion_points", "jerk", "force_time", "energy", "path")},
}
"""The entry point, and folder under plugins/, of every name that is not the core's."""


def where_to_get(kind: str, name: str, known: Collection[str], here: Collection[str]) -> str:
    """What to type where a name is missing because its plug-in is not installed. "" if that is not why.

    Args:
        kind: what was asked for: "skill", "world", ...
        name: its name.
        known: names of that kind that there are.
        here: plug-ins that are installed, whether or not they are selected and load.
    """
    home = HOMES.get(f"{kind}:{name}")
    if home is not None and home not in here:
        return f"{name} is in skillframe-{home}, which is not installed; type: {install_line(home)}"
    if home is None and not known and "lmc" not in here:
        return f"no plug-in with a {kind} is installed; type: {install_all()}"
    return ""


def install_line(home: str) -> str:
    """What to type to install a first-party plug-in: from the checkout where there is one."""
    return f"pip install -e plugins/{home}" if checkout() else f"pip install skillframe-{home}"


def install_all() -> str:
    """What to type to have a kind of skill at all."""
    return "make install" if checkout() else install_line("lmc")
