"""Description of an LMC skill: a headline, then the details."""

from __future__ import annotations

from math import degrees

import numpy as np

from skillframe.document import SkillFrame, read_frame
from skillframe.extend import Document
from skillframe_lmc.phase import Part, Phase, read_phase
from skillframe_lmc.words import axis_words, direction_words, exact_words, listed


def describe(document: Document) -> list[str]:
    """The lines, the headline first."""
    phase = read_phase(document)
    return [headline(phase), *_details(phase), *_messages(phase), _stops(phase), _frame(read_frame(document))]


def headline(phase: Phase) -> str:
    """The skill in one line."""
    move, turn = phase.translation, phase.rotation
    parts = []
    if move.desired_direction is not None:
        parts.append(f"push along {direction_words(move.desired_direction)} at {1e3 * move.speed:.3g} mm/s")
    if move.fully_compliant:
        parts.append("position free in every direction")
    elif len(move.compliant_axes):
        parts.append(f"free along {_axes(move)}")
    elif move.desired_direction is None:
        parts.append("holds its position")
    if turn.desired_direction is not None:
        parts.append(f"turn about {direction_words(turn.desired_direction)} at {degrees(turn.speed):.3g} degrees/s")
    if turn.fully_compliant:
        parts.append("turns freely about every axis")
    elif len(turn.compliant_axes):
        parts.append(f"turns freely about {_axes(turn)}")
    elif turn.desired_direction is None:
        parts.append("holds its orientation")
    return "; ".join(parts)


def _axes(part: Part) -> str:
    axes = part.compliant_axes
    if len(axes) != 2:
        return listed([axis_words(axis) for axis in axes])
    across = axis_words(np.cross(*axes) / np.linalg.norm(np.cross(*axes)))
    if across in ("x", "y", "z"):
        return listed([name for name in "xyz" if name != across])
    return f"every direction square to {across}"


def _details(phase: Phase) -> list[str]:
    lines = []
    for name, part, k, unit in (
        ("translation", phase.translation, "N/m", "J"), ("rotation", phase.rotation, "Nm/rad", "J"),
    ):  # fmt: skip
        facts = [
            _direction(part),
            *_free(part),
            f"stiffness {np.linalg.eigvalsh(part.stiffness).max():.4g} {k} at most",
        ]
        seen = part.evidence
        if not seen.get("held") and "work_teacher_j" in seen and "work_environment_j" in seen:
            facts.append(f"work of the teacher {seen['work_teacher_j']:.3g} {unit}, of the environment "
                         f"{seen['work_environment_j']:.3g} {unit}")  # fmt: skip
        lines.append(f"{name}: {'; '.join(facts)}")
    if phase.pitch is not None and all(p.desired_direction is not None for p in (phase.translation, phase.rotation)):
        lines.append(f"pitch: {1e3 * phase.pitch:.3g} mm of translation per radian of rotation")
    return lines


def _direction(part: Part) -> str:
    if part.desired_direction is None:
        return "held" if part.evidence.get("held") else "no desired direction"
    text = f"desired direction {exact_words(part.desired_direction)}"
    share, known = part.evidence.get("explained"), known_rad(part)
    if share is None or known is None:
        return text
    return (
        f"{text} (explains {100.0 * share:.0f} % of what was shown; the direction is known to about "
        f"{degrees(known):.0f} degrees)"
    )


def known_rad(part: Part) -> float | None:
    """Largest half width of the set of directions that explain as much [rad], or None."""
    known: float | None = part.evidence.get("feasible_half_width_rad")
    return known


def _free(part: Part) -> list[str]:
    if part.fully_compliant:
        return ["compliant in all three degrees of freedom"]
    return [f"compliant axis {exact_words(axis)}" for axis in part.compliant_axes]


def _messages(phase: Phase) -> list[str]:
    parts = {"translation": phase.translation, "rotation": phase.rotation}
    return [f"note: {name}: {text}" for name, part in parts.items() if (text := part.evidence.get("message"))]


def _stops(phase: Phase) -> str:
    stop = phase.stop
    ends = f"ends when nothing has moved for {stop.stall_s:g} s while pushing"
    if phase.translation.desired_direction is None and phase.rotation.desired_direction is None:
        ends = f"ends after {stop.time_limit_s:.1f} s"
    return (
        f"{ends}; pushes with {stop.lead_force_n:.0f} N and {stop.lead_torque_nm:.1f} Nm at most; gives up at "
        f"{stop.force_limit_n:.0f} N, {stop.time_limit_s:.0f} s or {1e3 * stop.travel_limit_m:.0f} mm"
    )


def _frame(frame: SkillFrame) -> str:
    axes = "axes of the tool's orientation at the start of the phase" if frame.from_start else "base axes"
    named = (
        ("learned at", frame.learned_at), ("hand at", frame.work_at),
        ("centre of compliance", frame.center_of_compliance),
    )  # fmt: skip
    points = [f"{what} ({', '.join(f'{x:g}' for x in point)})" for what, point in named]
    return f"{axes}; {', '.join(points)} (m, tool frame)"
