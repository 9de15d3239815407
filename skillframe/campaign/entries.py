"""The entries of `skills` in campaign.toml: "FILE.skill.json", or "TYPE:DEMO[,DEMO...][,KEY=VALUE...]".

The second learns that type of skill from demonstrations on the spot. The syntax is that of
`skillframe.document.source`; here only the files are told apart, to be checked and copied.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class SkillEntry(NamedTuple):
    """One entry, taken apart.

    Attributes:
        kind: type of a skill that is learned on the spot; "" for a skill file.
        files: the skill file, or the demonstrations.
        settings: "KEY=VALUE" for the learner.
    """

    kind: str
    files: tuple[str, ...]
    settings: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What the skill is called in results: the entry with file names instead of paths."""
        return self.moved(lambda file: Path(file).name).text

    @property
    def text(self) -> str:
        """The entry as it is written."""
        parts = ",".join((*self.files, *self.settings))
        return f"{self.kind}:{parts}" if self.kind else parts

    def moved(self, place: Callable[[str], str]) -> SkillEntry:
        """The entry with every file replaced."""
        return self._replace(files=tuple(place(file) for file in self.files))


def parse_entry(text: str) -> SkillEntry:
    """Take an entry apart."""
    kind, colon, rest = text.partition(":")
    if not colon:
        return SkillEntry("", (text,))
    parts = [part for part in rest.split(",") if part]
    return SkillEntry(kind, tuple(p for p in parts if "=" not in p), tuple(p for p in parts if "=" in p))
