"""Checks of any skill against the loop's contract (`skillframe.skill`).

Batched rows must equal single trials to 1e-9 (metres, radians, newtons), far above rounding and below a micrometre.
Coordinators have arrays (N, arms, ...).
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

import numpy as np

from skillframe.document import frame_at, new_document
from skillframe.extend import Document, LearnOptions, SkillType, Stalled
from skillframe.frames import Float, norm, rotation_vector
from skillframe.skill import Command, Skill, Status, row
from skillframe_testkit.checks import running
from skillframe_testkit.checks import start_checks as beginning
from skillframe_testkit.checks.examples import example_demonstrations
from skillframe_testkit.checks.playback import (
    AGREEMENT,
    TRIALS,
    arms_of,
    first_difference,
    observations_of,
    play,
    rows_of_command,
    with_row,
)
from skillframe_testkit.checks.problems import attempt, json_problems
from skillframe_testkit.checks.watch import printed, watched


def example_document(skill: SkillType) -> Document:
    """The type's own example document, or one learned from the example demonstrations."""
    from skillframe.document import learned

    return learned(skill, example_demonstrations()) if skill.example is None else skill.example()


def check_skill(skill: SkillType, document: Document | None = None) -> list[str]:
    """Problems of a skill type, with a document or `example_document`."""
    with watched() as seen:
        problems = _problems(skill, document)
    return problems or list(printed(seen))


def _problems(skill: SkillType, document: Document | None) -> list[str]:
    if document is None:
        try:
            document = example_document(skill)
        except (Exception, SystemExit) as error:  # code of a plug-in
            what = f"no document to try it with: {type(error).__name__}: {error}"
            return [f"{what}; give SkillType.example, or a document"]
    stop = attempt("builds", partial(_unusable, skill, copy.deepcopy(document))) or attempt(
        "answers in time", partial(running.answers_in_time, skill, copy.deepcopy(document))
    )
    rest = {what: check for what, check in CHECKS.items() if what != "answers in time"}
    return stop or [p for what, check in rest.items() for p in attempt(what, partial(check, skill, document))]


def _unusable(skill: SkillType, document: Document) -> Iterator[str]:
    built = skill.build(document)
    if not isinstance(built, Skill):
        yield f"build gave {type(built).__name__}, not a skillframe.Skill"


def skill_warnings(skill: SkillType, document: Document | None = None) -> list[str]:
    """Warnings on a skill that never ends and does not state it."""
    try:
        with watched():
            document = example_document(skill) if document is None else document
            return list(running.end_warnings(skill, document))
    except (Exception, SystemExit):  # reported by `check_skill`
        return []


def builds(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that building returns a `Skill` and keeps the document."""
    before = copy.deepcopy(document)
    yield from _unusable(skill, document)
    if document != before:
        yield "build changes the document it is given"


def answers_in_shape(skill: SkillType, document: Document) -> Iterator[str]:
    """Check shapes, finite values, rotations and symmetric gains of commands."""
    for command in play(skill.build(document), observations_of(skill, document), range(TRIALS)):
        problems = list(_command_problems(command, (TRIALS, *arms_of(skill, document))))
        if problems:
            yield from problems
            return


def _command_problems(command: Command, lead: tuple[int, ...]) -> Iterator[str]:
    shapes = {
        "pose.position": (command.pose.position, (*lead, 3)), "pose.rotation": (command.pose.rotation, (*lead, 3, 3)),
        "twist": (command.twist, (*lead, 6)), "feedforward": (command.feedforward, (*lead, 6)),
        "status": (command.status, lead[:1]), "reason": (command.reason, lead[:1]),
    }  # fmt: skip
    wrong = [f"{k} has shape {np.shape(v)}, expected {s}" for k, (v, s) in shapes.items() if np.shape(v) != s]
    if wrong:
        yield from wrong
        return
    for name in ("pose.position", "pose.rotation", "twist", "feedforward"):
        if not np.all(np.isfinite(shapes[name][0])):
            yield f"{name} holds values that are not finite"
    rotation = command.pose.rotation
    if np.abs(np.swapaxes(rotation, -1, -2) @ rotation - np.eye(3)).max() > 1e-6:
        yield "pose.rotation is not orthonormal"
    yield from _gain_problems("stiffness", command.impedance.stiffness, lead)
    if command.impedance.damping is not None:
        yield from _gain_problems("damping", command.impedance.damping, lead)


def _gain_problems(name: str, gain: Float, lead: tuple[int, ...]) -> Iterator[str]:
    if np.shape(gain) not in ((6, 6), (*lead, 6, 6)):
        yield f"{name} has shape {np.shape(gain)}, expected (6, 6) or {(*lead, 6, 6)}"
        return
    scale = max(float(np.abs(gain).max()), 1.0)
    if np.abs(gain - np.swapaxes(gain, -1, -2)).max() > 1e-9 * scale:
        yield f"{name} is not symmetric"
    elif np.linalg.eigvalsh(gain).min() < -1e-9 * scale:
        yield f"{name} is not positive semi-definite"


def starts_without_a_bump(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that the first command has the tool's pose and little force."""
    observations = observations_of(skill, document, ticks=1, dt=1e-3)
    command = play(skill.build(document), observations, range(TRIALS))[0]
    measured = observations[0].pose
    step = norm(command.pose.position - measured.position).max()
    turn = norm(rotation_vector(command.pose.rotation @ np.swapaxes(measured.rotation, -1, -2))).max()
    force, torque = norm(command.feedforward[..., :3]).max(), norm(command.feedforward[..., 3:]).max()
    if step > 2e-3 or turn > 5e-3:  # m, rad, more than a resting tool can follow
        yield f"the first desired pose is {1e3 * step:.3g} mm and {turn:.3g} rad away from where the tool is"
    if force > 1.0 or torque > 0.1:  # N, Nm
        yield f"the first feed-forward is {force:.3g} N and {torque:.3g} Nm; let it grow from nothing"


def rows_equal_single_trials(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that each row of a batch equals the trial alone."""
    observations = observations_of(skill, document)
    together = play(skill.build(document), observations, range(TRIALS))
    for i in range(TRIALS):
        alone = play(skill.build(document), [row(o, i) for o in observations], [i])
        yield from first_difference(together, alone, slice(i, i + 1), AGREEMENT, f"trial {i} of {TRIALS} against alone")


def rows_are_independent(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that trials do not affect each other."""
    observations, others = observations_of(skill, document, 1), observations_of(skill, document, 2)
    mixed = [with_row(other, own, 0) for other, own in zip(others, observations, strict=True)]
    first = play(skill.build(document), observations, range(TRIALS))
    second = play(skill.build(document), mixed, [0, *range(100, 99 + TRIALS)])
    one = slice(0, 1)
    own, again = ([rows_of_command(command, one) for command in commands] for commands in (first, second))
    yield from first_difference(own, again, one, AGREEMENT, "trial 0 among other trials")


def repeats_with_its_seed(skill: SkillType, document: Document) -> Iterator[str]:
    """Check reproducibility by seed, without numpy's global generator."""
    state = np.random.get_state(legacy=False)  # noqa: NPY002 - watched, not used
    first = play(skill.build(document), observations_of(skill, document), range(TRIALS))
    again = play(skill.build(document), observations_of(skill, document), range(TRIALS))
    yield from first_difference(first, again, slice(None), 0.0, "the same seeds run twice")
    if str(np.random.get_state(legacy=False)) != str(state):  # noqa: NPY002
        yield "draws from numpy's global generator; use the generators handed to start"


def ends_with_a_reason(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that status is valid and has a reason exactly when a trial has ended."""
    for command in play(skill.build(document), observations_of(skill, document, ticks=200, dt=0.1), range(TRIALS)):
        status = np.asarray(command.status)
        if not np.issubdtype(status.dtype, np.integer) or not set(status.tolist()) <= {int(s) for s in Status}:
            yield f"status holds {sorted(set(status.tolist()))} ({status.dtype}), expected the integers of Status"
            return
        for code, reason in zip(status.tolist(), command.reason.tolist(), strict=True):
            if not isinstance(reason, str) or bool(reason) != (code != Status.RUNNING):
                yield f"status {Status(code).name} comes with the reason {reason!r}; give one exactly at the end"
                return


def survives_json(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that the document is plain JSON, and equivalent after a round trip."""
    import json

    yield from json_problems(document)
    back = json.loads(json.dumps(document))
    first = play(skill.build(document), observations_of(skill, document), range(TRIALS))
    second = play(skill.build(back), observations_of(skill, document), range(TRIALS))
    yield from first_difference(first, second, slice(None), 0.0, "built from the document read back")


def says_what_it_does(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that `describe` returns lines, `advice` two sentences, and `explain` SVG."""
    lines = [] if skill.describe is None else skill.describe(document)
    if not lines or not all(isinstance(line, str) and line for line in lines):
        yield f"describe gave {lines!r}; give a few lines of words, for `skillframe show`"
    given = ("none", "none") if skill.advice is None else skill.advice(document)
    if len(given) != 2 or not all(text and "\n" not in text for text in given):
        yield f"advice gave {given!r}; give two sentences, how sure what was learned is, and what to do next"
    for picture in [] if skill.explain is None else skill.explain(document):
        if ElementTree.fromstring(picture.svg).tag.rpartition("}")[2] != "svg":
            yield f"explain's picture {picture.title!r} is not SVG"


def finds_the_way_on(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that the document for a stall is valid, runs, and begins at the stall."""
    if skill.exception is None:
        return
    frame = document.get("frame") or frame_at([0.0, 0.0, 0.0], axes="base")
    body = skill.exception(
        Stalled(way=(0.0, 0.0, -1.0), radius=0.004, tilt=0.05, friction=0.3, frame=frame, options=LearnOptions())
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
    if not np.isfinite(away) or away > 0.05:  # m
        yield f"its first desired position is {1e3 * away:.0f} mm from the first pose that it sees; search about that"


CHECKS: Mapping[str, Callable[[SkillType, Document], Iterable[str]]] = {
    "builds": builds,
    "answers in time": running.answers_in_time,
    "answers in shape": answers_in_shape,
    "starts without a bump": starts_without_a_bump,
    "batched rows equal single trials": rows_equal_single_trials,
    "rows are independent": rows_are_independent,
    "repeats with its seed": repeats_with_its_seed,
    "ends with a reason": ends_with_a_reason,
    "survives JSON": survives_json,
    "says what it does": says_what_it_does,
    "runs for two seconds": running.runs_for_two_seconds,
    "leaves nothing behind": running.leaves_nothing_behind,
    "remembers little": running.remembers_little,
    "goes by time": beginning.goes_by_time,
    "starts again": beginning.starts_again,
    "restarts some trials": beginning.restarts_some_trials,
    "writes its journal": beginning.writes_its_journal,
    "finds the way on": finds_the_way_on,
}
