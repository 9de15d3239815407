"""What a person should know about the rows of a campaign besides their rates, each in a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skillframe.campaign.rows import Row
from skillframe.campaign.store import Environment
from skillframe.campaign.trouble import looks_like_trouble
from skillframe.campaign.verify import edited_results

NOTABLE = ("processor", "platform")
"""Workers may differ in these; in everything else they must not."""


def remarks(
    folder: Path, rows: Sequence[Row], *, unchecked: int, environments: Sequence[Environment],
    summary: Mapping[str, Any] | None,
) -> list[str]:  # fmt: skip
    """Sentences about rows, most serious first, or none where all is well.

    Args:
        folder: the campaign's folder, for what to type.
        rows: its rows.
        unchecked: how many lines of rows.jsonl carry no checksum.
        environments: where rows ran.
        summary: content of summary.json, if it is there.
    """
    return [text for text in (
        _trouble(folder, rows) if unchecked else "", edited_results(folder, summary), _dead(rows),
        _mixed(environments), _unchecked(unchecked),
    ) if text]  # fmt: skip


def _trouble(folder: Path, rows: Sequence[Row]) -> str:
    """Rows of skillframe 0.1, which took trouble of the environment for failures of the skill."""
    found = [row["failure"] for row in rows if looks_like_trouble(row["failure"])]
    if not found:
        return ""
    return (
        f"{len(found)} of {len(rows)} rows look like trouble of the machine, and not of a skill (the first: "
        f"{found[0].removeprefix('error: ')!r}); skillframe 0.1 counted it as failure, so do not trust the rates: type "
        f"skillframe campaign run {folder / 'campaign.toml'} --out NEW"
    )


def _dead(rows: Sequence[Row]) -> str:
    count = sum(row["failure"] in ("worker died (memory)", "worker died (killed)") for row in rows)
    if not count:
        return ""
    return (
        f"{count} rows are of trials whose worker went over its memory limit or was killed, alone and twice; most "
        "likely it was the trial, but that is not known"
    )


def _mixed(environments: Sequence[Environment]) -> str:
    kinds = {tuple(e.get(name, "unknown") for name in NOTABLE) for e in environments}
    if len(kinds) < 2:
        return ""
    return (
        f"rows ran on {len(kinds)} kinds of machine ({'; '.join(sorted(' on '.join(kind) for kind in kinds))}): their "
        "last bits may depend on which; replay says where a trial ran"
    )


def _unchecked(count: int) -> str:
    if not count:
        return ""
    return (
        f"{count} lines of rows.jsonl were written by skillframe 0.1 and carry no checksum: that nobody changed them "
        "cannot be told"
    )
