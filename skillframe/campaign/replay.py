"""One trial of a campaign, run again alone: the same row to the last bit, and its trace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from skillframe.campaign.folder import campaign_hash, load
from skillframe.campaign.provenance import environment, environment_differences
from skillframe.campaign.rows import TRACE, ChunkJob, Row, dead_row, differences
from skillframe.campaign.store import Content, read_content
from skillframe.campaign.trouble import CampaignError, Evaluate, Raised, attempt
from skillframe.errors import InputError, UnknownName


class Replayed(NamedTuple):
    """A trial then and now.

    Attributes:
        then: the campaign's row.
        now: the row of the trial run alone.
        changed: columns that are not bit-identical, with both values; two NaN are the same.
        environment: one line per version or processor that is not what the trial ran on.
        trace: content of the trace file.
    """

    then: Row
    now: Row
    changed: dict[str, tuple[Any, Any]]
    environment: list[str]
    trace: bytes | None


def replay_trial(
    folder: Path, trial: int, evaluate: Evaluate, skill: str | None = None, params: type | None = None
) -> Replayed:
    """Run a trial again.

    Args:
        folder: the campaign's folder.
        trial: its number.
        evaluate: runs a chunk.
        skill: label of the skill, or its beginning if only one begins so; None for the first.
        params: the world's parameter dataclass; None looks it up.

    Raises:
        InputError: no such folder, rows that are not this campaign's, or the trial has no row (yet).
        UnknownName: no such skill.
        CampaignError: it cannot run here.
    """
    spec = load(folder, params)
    label = pick_label(spec.labels, skill)
    found = read_content(folder, campaign_hash(spec), spec)
    done = found.done
    if (trial, label) not in done:
        numbers = sorted(t for t, name in done if name == label)
        have = f"it has {len(numbers)} trials" + (f", {numbers[0]} to {numbers[-1]}" if numbers else "")
        raise InputError(folder, f"trial {trial} of {label} has no row ({have})", "choose another trial, or resume")
    job = ChunkJob(
        spec=spec.plain(), folder=str(folder.resolve()), skill=spec.labels.index(label), trials=(trial,), traces=True
    )
    answer = attempt(evaluate, job)
    if isinstance(answer, Raised) and answer.trouble:
        raise CampaignError(f"trial {trial} of {label} cannot run here: {answer.text}")
    now = dead_row(spec, job.skill, trial, f"error: {answer.text}") if isinstance(answer, Raised) else answer[0]
    trace = now.pop(TRACE, None)
    ran_on = _ran_on(found, trial, label)
    changes = environment_differences(ran_on, environment()) if ran_on else []
    then = done[trial, label]
    return Replayed(then, now, differences(then, now), changes, trace)


def _ran_on(found: Content, trial: int, label: str) -> Mapping[str, str]:
    """Where a trial's row ran. For a row that does not say, where the campaign last ran."""
    number = found.done.ran_on((trial, label))
    if number is not None and number < len(found.environments):
        return found.environments[number]
    ran_on = [session["environment"] for session in found.sessions if "environment" in session]
    return ran_on[-1] if ran_on else {}


def pick_label(labels: Sequence[str], skill: str | None) -> str:
    """The label that a person means.

    Raises:
        UnknownName: none or several.
    """
    if skill is None or skill in labels:
        return skill or labels[0]
    meant = [label for label in labels if label.startswith(skill)]
    if len(meant) != 1:
        raise UnknownName("skill", skill, labels)
    return meant[0]
