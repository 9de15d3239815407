"""Which first-party plug-in a name ships in, so that a missing one can be named with the line that installs it."""

from __future__ import annotations

from collections.abc import Collection

HOMES = {
    "skill:lmc": "lmc",
    "skill:policy": "segmenter",
    **{f"segmenter:{name}": "segmenter" for name in ("wrench_hmm", "pose_hmm", "zvc")},
    **{f"skill:{name}": "search" for name in ("search", "spiral", "random_walk")},
    **{f"skill:{name}": "baselines" for name in ("replay", "dmp", "gmr", "seds")},
    "coordinator:dual_arm": "dualarm",
    "skill:dual_arm": "dualarm",  # asked for as any other behaviour
    "world:dual_peg": "dualarm",
    **{f"row:{number}": "papers" for number in range(1, 24)},
    "command:reproduce": "papers",
}
"""The entry point, and folder under plugins/, of every name that is not the core's."""


def where_to_get(kind: str, name: str, known: Collection[str], here: Collection[str]) -> str:
    """What to type where a name is missing because its plug-in is not installed; "" if that is not why.

    Args:
        kind: what was asked for: "skill", "world", ...
        name: its name.
        known: names of that kind that there are.
        here: plug-ins that are installed, whether or not they are selected and load.
    """
    home = HOMES.get(f"{kind}:{name}")
    if home is not None and home not in here:
        return f"{name} is in skillframe-{home}, which is not installed; type: pip install -e plugins/{home}"
    if home is None and not known and "lmc" not in here:
        return f"no plug-in with a {kind} is installed; type: make install"
    return ""
