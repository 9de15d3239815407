"""How far a campaign is, read from its folder alone, also while another process runs it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skillframe.campaign.folder import campaign_hash, load
from skillframe.campaign.lock import holder
from skillframe.campaign.remarks import remarks
from skillframe.campaign.stopping import StopRule
from skillframe.campaign.store import ordered, read_content
from skillframe.campaign.summary import SUMMARY, comparisons, rates, read_summary


def status_of(folder: Path, params: type | None = None) -> dict[str, Any]:
    """The state of a campaign as plain JSON values.

    Args:
        folder: the campaign's folder.
        params: the world's parameter dataclass; None looks it up.

    Returns:
        `name`, `robot`, `world`, `rows`, `planned_rows`, `complete`, `stopped_after_trial`, `running` (null, or `pid`
        and `host` of the process that is writing), `skills`, `comparisons` and `race` as in summary.json, `remarks`:
        sentences to be read first.

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
        ),
    }  # fmt: skip
