"""Progress, stored results and remarks of a campaign, read from its folder, also while another process runs it.

results.csv is written at the end. Remarks say what a reader should know about the rows besides their rates.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.driver import looks_like_trouble
from skillframe.campaign.folder import SUMMARY, campaign_hash, holder, load
from skillframe.campaign.provenance import edited_results
from skillframe.campaign.race import Race, StopRule
from skillframe.campaign.rows import EXTRA, LEFT_OUT, Row, cell_of
from skillframe.campaign.spec import RaceKeys
from skillframe.campaign.store import RESULTS, ROWS, Environment, ordered, read_content
from skillframe.campaign.summary import comparisons, rates, read_summary
from skillframe.config import build
from skillframe.document.file import parse_source
from skillframe.errors import SkillframeError

NOTABLE = ("processor", "platform")
"""Entries of an environment that may differ between workers."""


LOST = "lost"
"""Key of a note in rows.jsonl on a job that ended without rows."""


class RanAgain(NamedTuple):
    """Trials whose rows are not from their first run.

    Attributes:
        trials: how many.
        why: how the first of these runs ended, in words.
    """

    trials: int
    why: str


def ran_again(sessions: Iterable[Mapping[str, Any]], done: Mapping[tuple[int, str], Row]) -> RanAgain | None:
    """Trials that ran again after a run without rows, unless one of their rows reports the loss.

    If one of several trials of a job raises, its row says so, and the job needs no remark.
    """
    seen: set[tuple[int, str]] = set()
    first = ""
    for lost in (session[LOST] for session in sessions if isinstance(session.get(LOST), dict)):
        keys = {(trial, lost["skill"]) for trial in lost["trials"]}
        if keys <= done.keys() and not any(done[key].get("ended_by") == "lost" for key in keys):
            seen |= keys
            first = first or f"trials {min(lost['trials'])} to {max(lost['trials'])} of {lost['skill']}: {lost['why']}"
    return RanAgain(len(seen), first) if seen else None


def remarks(
    folder: Path, rows: Sequence[Row], *, unchecked: int, environments: Sequence[Environment],
    summary: Mapping[str, Any] | None, again: RanAgain | None = None,
) -> list[str]:  # fmt: skip
    """Sentences about rows, most serious first."""
    found: list[str] = []
    # skillframe 0.1, whose rows have no checksum, counted trouble of the environment as failures of the skill
    trouble = [row["failure"] for row in rows if looks_like_trouble(row["failure"])] if unchecked else []
    if trouble:
        found.append(
            f"{len(trouble)} of {len(rows)} rows are probably trouble of the machine, and not of a skill (the first: "
            f"{trouble[0].removeprefix('error: ')!r}); skillframe 0.1 counted it as failure, so do not trust the "
            f"rates: type skillframe campaign run {folder / 'campaign.toml'} --out NEW"
        )
    if edited := edited_results(folder, summary):
        found.append(edited)
    dead = sum(row["failure"] in ("worker died (memory)", "worker died (killed)") for row in rows)
    if dead:
        found.append(
            f"{dead} rows are of trials whose worker went over its memory limit or was killed, alone and twice; most "
            "likely it was the trial, but that is not known"
        )
    if again is not None:
        found.append(said_again(again))
    kinds = {tuple(e.get(name, "unknown") for name in NOTABLE) for e in environments}
    if len(kinds) > 1:
        found.append(
            f"rows ran on {len(kinds)} kinds of machine ({'; '.join(sorted(' on '.join(kind) for kind in kinds))}): "
            "their last bits may depend on which; replay says where a trial ran"
        )
    if unchecked:
        found.append(
            f"{unchecked} lines of rows.jsonl were written by skillframe 0.1 and carry no checksum: changes of "
            "them cannot be detected"
        )
    return found


def said_again(again: RanAgain) -> str:
    """Sentence on trials whose first run is not counted."""
    return (
        f"{again.trials} trials ran more than once and only their last run is counted: the first run ended without a "
        f"result ({again.why})"
    )


def runs_now(folder: Path) -> bool:
    """Whether a process is writing this campaign."""
    return holder(folder) is not None


def has_ended(folder: Path) -> bool:
    """Whether a folder will not change by itself: its campaign is complete, or it holds no rows.

    Raises:
        InputError: a damaged summary.json.
    """
    if not (folder / "campaign.toml").is_file() or ((folder / RESULTS).is_file() and not (folder / ROWS).is_file()):
        return True
    return not runs_now(folder) and (folder / SUMMARY).is_file() and read_summary(folder).get("complete") is True


def live_table(folder: Path, skills: Sequence[object], spec: Mapping[str, Any] | None = None) -> str | None:
    """The stored rows as the text of a results.csv. None where results.csv itself is valid.

    Raises:
        InputError: damaged rows.
    """
    if not (folder / ROWS).is_file() or ((folder / RESULTS).is_file() and not runs_now(folder)):
        return None
    rows = list(read_content(folder).done.values())
    try:
        labels = [parse_source(str(text), folder).label for text in skills]
    except SkillframeError:
        labels = []
    return _text(_raced(rows, labels, spec or {}), labels) if rows else None


def _raced(rows: list[Row], labels: Sequence[str], spec: Mapping[str, Any]) -> list[Row]:
    keys, trials = spec.get("race"), spec.get("trials")
    if not isinstance(keys, dict) or not isinstance(trials, int) or not {row["skill"] for row in rows} <= set(labels):
        return rows
    race = Race(labels, trials, build(RaceKeys, keys, "race"))
    race.add(rows)
    gone, reach = race.left, race.reach
    kept = [row for row in rows if row["trial"] < reach[row["skill"]]]
    return [{**row, LEFT_OUT: gone[row["skill"]].after if row["skill"] in gone else ""} for row in kept]


def _text(rows: Sequence[Row], labels: Sequence[str]) -> str:
    order: Mapping[str, int] = {label: i for i, label in enumerate(labels)}
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in EXTRA]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)

    def place(row: Row) -> tuple[Any, ...]:
        return row["trial"], order.get(row["skill"], len(order)), row["skill"]

    writer.writerows([cell_of(row, name) for name in names] for row in sorted(rows, key=place))
    return text.getvalue()


def status_of(folder: Path, params: type | None = None) -> dict[str, Any]:
    """The state of a campaign as JSON values.

    Returns:
        `name`, `robot`, `world`, `rows`, `planned_rows`, `complete`, `stopped_after_trial`, `running` (null, or `pid`
        and `host` of the process that is writing), `skills`, `comparisons` and `race` as in summary.json, and
        `remarks`, sentences.

    Raises:
        InputError: not a campaign's folder, or rows of another campaign or changed ones.
    """
    spec = load(folder, params)
    found = read_content(folder, campaign_hash(spec), spec)
    done = found.done
    rule = StopRule(spec)
    rule.add(done.values())
    complete = rule.after is not None or len(done) == rule.total(len(done))
    rows, owner = ordered(spec, done, rule.after, rule.left), holder(folder)
    return {
        "name": spec.name,
        "robot": spec.robot_name,
        "world": spec.world_name,
        "rows": len(rows),
        "planned_rows": rule.planned,
        "complete": complete,
        "stopped_after_trial": rule.after,
        "running": {"pid": owner[0], "host": owner[1]} if owner else None,
        "skills": rates(spec, rows, complete),
        "comparisons": comparisons(spec, rows, complete, rule.race),
        **({"race": rule.race.outcome()} if rule.race else {}),
        "remarks": remarks(
            folder, rows, unchecked=found.unchecked, environments=found.environments,
            summary=read_summary(folder) if (folder / SUMMARY).is_file() and not owner else None,
            again=ran_again(found.sessions, done),
        ),
    }  # fmt: skip
