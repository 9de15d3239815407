"""What a kind of skill must do that says it is an exception strategy (`skillframe.extend.stalled`)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.conformance.play import observations_of, play
from skillframe.document.file import new_document
from skillframe.document.frame import frame_at
from skillframe.extend.records import Document, LearnOptions, SkillType, Stalled
from skillframe.frames import norm

WIDE_M, NEAR_M = 0.004, 0.05


def finds_the_way_on(skill: SkillType, document: Document) -> Iterator[str]:
    """A body for where another skill stalls makes a document that checks and runs, and begins where it is shown."""
    if skill.exception is None:
        return
    frame = document.get("frame") or frame_at([0.0, 0.0, 0.0], axes="base")
    body = skill.exception(
        Stalled(way=(0.0, 0.0, -1.0), radius=WIDE_M, tilt=0.05, friction=0.3, frame=frame, options=LearnOptions())
    )
    made = new_document(skill, body)
    if len(made["phases"]) != 1:
        yield f"exception gave {len(made['phases'])} phases; a search on a stall has one"
        return
    if skill.check is not None:
        skill.check(made)
    seen = observations_of(skill, made)
    first = play(skill.build(made), seen[:1], range(len(seen[0].time)))[0]
    away = float(norm(first.pose.position - seen[0].pose.position).max())
    if not np.isfinite(away) or away > NEAR_M:
        yield f"its first desired position is {1e3 * away:.0f} mm from the first pose that it sees; search about that"
