"""One finding of the audit, and the robot.toml lines that fix a link's inertia."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from skillframe.robot.spec import LinkInertia


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A finding.

    Attributes:
        code: fixed word for scripts; severity: "fatal" makes the robot unusable for dynamics.
        where: link or joint; message: what is wrong; fix: what to do about it.
    """

    code: str
    severity: Literal["fatal", "warning"]
    where: str
    message: str
    fix: str


def overlay_fix(inertias: Mapping[str, LinkInertia]) -> str:
    """The fix of a message: robot.toml lines that give links an inertia."""
    lines = [_overlay_line(link, inertia) for link, inertia in inertias.items()]
    guessed = [inertia.mass for inertia in inertias.values() if inertia.guessed]
    how = "type --mass and the data sheet's total, or --class"
    scale = f" ({sum(guessed):.3g} kg together; {how})" if len(guessed) > 1 else ""
    head = f"put this into a robot.toml, with figures from CAD where they are guesses{scale}:"
    return "\n".join([head, "[inertia]", *lines])


def _overlay_line(link: str, inertia: LinkInertia) -> str:
    key = link if re.fullmatch(r"[A-Za-z0-9_-]+", link) else json.dumps(link)
    com, moments = (", ".join(f"{x:g}" for x in values) for values in (inertia.com, inertia.inertia))
    guessed = ", guessed = true" if inertia.guessed else ""
    return f"{key} = {{ mass = {inertia.mass:g}, com = [{com}], inertia = [{moments}]{guessed} }}"
