"""The first-party plug-in of each name, so that an error can give the command that installs it."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path

from skillframe.files import checkout

READERS = {
    ".npy": "arrays", ".mat": "arrays", ".json": "arrays", ".jsonl": "arrays", ".h5": "hdf5", ".hdf5": "hdf5",
    ".parquet": "parquet", ".bag": "rosbag", ".db3": "rosbag", ".mcap": "mcap",
}  # fmt: skip
"""Reader by ending, of recordings that the core does not read."""


@cache
def homes() -> Mapping[str, str]:
    """Folder under plugins/ ("lmc") of each name outside the core ("skill:lmc")."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    return {f"{kind}:{name}": home for kind, own in table.items() for home, names in own.items() for name in names}


def where_to_get(kind: str, name: str, known: Collection[str], here: Collection[str]) -> str:
    """A sentence on how to install the plug-in of a missing name, or "".

    Args:
        kind: of the name: "skill", "world", ...
        name: the missing name.
        known: existing names of that kind.
        here: installed plug-ins, whether or not they are selected and load.
    """
    home = homes().get(f"{kind}:{name}")
    if home is not None and home not in here:
        return f"{name} is in skillframe-{home}, which is not installed; type: {install_line(home)}"
    if home is None and not known and "lmc" not in here:
        return f"no plug-in with a {kind} is installed; type: {install_all()}"
    return ""


def install_line(home: str) -> str:
    """The command that installs a first-party plug-in, from the checkout if there is one."""
    return f"pip install -e plugins/{home}" if checkout() else f"pip install skillframe-{home}"


def install_all() -> str:
    """The command that installs kinds of skill."""
    return "make install" if checkout() else install_line("lmc")
