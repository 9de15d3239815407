"""`run` and `SingleRun`: one run of a skill in a world, and its outcome."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from skillframe.api.inputs import File, Robot, Settings, World, robot_of, scene_of
from skillframe.api.learning import LearnedSkill, Skills, skill_of
from skillframe.config.units import DURATION, TRACE_RATE
from skillframe.demonstration.record import resolve_point
from skillframe.document.frame import load_places
from skillframe.errors import SkillframeError, UnknownName
from skillframe.execution.executor import Setup, require_starts, simulate
from skillframe.execution.prepare import prepare
from skillframe.execution.result import ArmsResult
from skillframe.execution.trace import ScoreFailed, Trace, about, score_notes, scores_of
from skillframe.extend.outputs import Moment, no_progress
from skillframe.extend.registry import registry
from skillframe.robot.audit import resistance_note
from skillframe.robot.link_checks import guess_note
from skillframe.skill import Skill
from skillframe.world.scene import Scene

LONGEST_S, RATE_HZ = DURATION.nominal, TRACE_RATE.nominal
"""Default longest run [s] and rate of the trace [Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class SingleRun:
    """One run.

    Attributes:
        trace: everything over time, and in `meta` the outcome and the scene's geometry.
        arms: traces of several arms by name, otherwise empty.
        interrupted: whether Ctrl-C came before the end.
        unscored: the error of a score that failed; the run itself is complete.
    """

    trace: Trace
    arms: dict[str, Trace] = field(default_factory=dict)
    interrupted: bool = False
    unscored: SkillframeError | None = None

    @classmethod
    def load(cls, path: File) -> SingleRun:
        """Read a trace file.

        Raises:
            InputError: missing, not a trace, or of a newer version.
        """
        return cls(trace=Trace.load(Path(path)))

    @property
    def success(self) -> bool:
        """Whether the goal was reached and no limit was broken."""
        return bool(self.trace.meta["success"])

    @property
    def failure(self) -> str:
        """Why it failed, in words. "" for a success."""
        return str(self.trace.meta["failure"])

    @property
    def reason(self) -> str:
        """Why the run ended, in words."""
        return str(self.trace.meta["reason"])

    @property
    def duration_s(self) -> float:
        """Simulated time [s]."""
        return float(self.trace.meta["duration_s"])

    @property
    def peak_force_n(self) -> float:
        """Peak contact force [N]: the largest of one control tick in simulation."""
        return float(self.trace.meta["peak_force_n"])

    @property
    def final_error_m(self) -> float:
        """Distance to the goal at the end [m]."""
        return float(self.trace.meta["final_error_m"])

    @property
    def final_error_rad(self) -> float:
        """Angle to the goal at the end [rad]."""
        return float(self.trace.meta["final_error_rad"])

    @property
    def scores(self) -> dict[str, float | None]:
        """The requested scores by name, in SI units. None where this run has no such figure."""
        return {name: about["value"] for name, about in (self.trace.meta.get("scores") or {}).items() if about}

    @property
    def events(self) -> list[tuple[float, str]]:
        """Time [s] and text of events: phases that began, parts that failed."""
        return [(float(when), str(what)) for when, what in self.trace.meta.get("events") or []]

    def save(self, path: File) -> SingleRun:
        """Write the trace (.npz) as a whole.

        Raises:
            InputError: the file cannot be written.
        """
        self.trace.save(Path(path))
        return self

    def write(self, output: str, out: File, progress: Callable[[float, float], None] | None = None) -> str:
        """Write a file of a kind that a plug-in provides: an option of `skillframe run`, such as "replay" or "video".

        Args:
            output: the kind.
            out: the file.
            progress: called with the amount done and the total.

        Returns:
            a note on how it was made, or "".

        Raises:
            UnknownName: no plug-in provides that kind.
            InputError: the file's name is not one of that kind, or it cannot be written.
        """
        record = registry().output(output)
        if record.of != "run":
            known = [each.name for each in registry().records("output") if each.of == "run"]
            raise UnknownName("output of a run", output, known)
        return record.write(self.trace, Path(out), progress or no_progress)

    def replay(self, out: File) -> Path:
        """Write a page with a 3-D replay and plots (.html). Raises as `write`."""
        self.write("replay", out)
        return Path(out)

    def video(self, out: File, progress: Callable[[float, float], None] | None = None) -> Path:
        """Write a video (.mp4).

        Args:
            out: the file.
            progress: called after each frame with frames done and in total.

        Raises:
            InputError, UnknownName: as `write`.
        """
        self.write("video", out, progress)
        return Path(out)

    def picture(self, out: File, time: float | None = None, *, far: bool = False) -> Path:
        """Write a still of the scene (.png): the tool and the fixture near its tip, cut open.

        Args:
            out: the file.
            time: of the run [s]; None for its end.
            far: show the whole scene instead.

        Raises:
            InputError: the trace holds no geometry, or the file cannot be written.
            UnknownName: skillframe-reports, which draws it, is not installed.
        """
        registry().output("still").write(Moment(self.trace, time, far), Path(out), no_progress)
        return Path(out)

    def __repr__(self) -> str:
        meta, said = self.trace.meta, "success" if self.success else f"failure: {self.failure}"
        what = f"{meta.get('skill')} by {meta['robot']} in {meta['world']}"
        return f"SingleRun({what}: {said}; {self.duration_s:.2f} s, peak force in simulation {self.peak_force_n:.1f} N)"


def run(
    skill: Skills | Skill, world: World, robot: Robot = "panda", *, coc: str | None = None,
    set: Settings | None = None, seed: int = 0, duration_s: float = LONGEST_S, rate_hz: float = RATE_HZ,
    scores: Sequence[str] = (), progress: Callable[[float, float], None] | None = None,
    places: File | None = None,
) -> SingleRun:  # fmt: skip
    """Run a skill once in a simulated world.

    Args:
        skill: a result of `learn`, a skill file, "TYPE:DEMONSTRATION", a document, or a runnable `Skill`.
        world: a name, a fixture file, or a scene of your own.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        coc: centre of compliance, "x,y,z" [m] in the tool frame or a frame's name; None as learned.
        set: deviations from the nominal, {"start.offset_x": 0.008, "fixture.tilt_y": "5deg"}.
        seed: of the sensor noise.
        duration_s: longest run [simulated s].
        rate_hz: of the trace.
        scores: names of figures that plug-ins compute from the trace.
        progress: called with seconds simulated and the longest duration.
        places: TOML file with poses of places in base, for a skill that uses places; None: those of the world.

    Raises:
        SkillframeError: an argument cannot be used, or a score failed; says what, where, and what to do.
        KeyboardInterrupt: Ctrl-C.
    """
    done = once(
        skill, world, robot, coc=coc, set=set, seed=seed, duration_s=duration_s, rate_hz=rate_hz, scores=scores,
        progress=progress, places=places,
    )  # fmt: skip
    if done.interrupted:
        raise KeyboardInterrupt
    if done.unscored is not None:
        raise done.unscored
    return done


def once(
    skill: Skills | Skill, world: World, robot: Robot, *, coc: str | None, set: Settings | None, seed: int,
    duration_s: float, rate_hz: float, scores: Sequence[str], progress: Callable[[float, float], None] | None,
    places: File | None = None,
) -> SingleRun:  # fmt: skip
    """As `run`, but returns also a run that Ctrl-C ended, or whose scores failed."""
    for each in scores:
        about(each)  # refuse an unknown one before the run
    scene, draws = scene_of(world, set, depth=3)
    own = skill if isinstance(skill, Skill) else None
    learned = None if isinstance(skill, Skill) else skill_of(skill)
    model = robot_of(robot)
    if own is not None:
        center = resolve_point(coc, scene.tool.frames)
        runnable, setup = own, Setup(robot=model, scene=scene, center_of_compliance=center)
    else:
        assert learned is not None
        told = None if places is None else load_places(Path(places))
        runnable, setup = prepare(model, scene, learned.document, coc, told)
    result = simulate(
        runnable, setup, {key: np.array([value]) for key, value in draws.items()}, [np.random.default_rng(seed)],
        duration_s=duration_s, trace_hz=rate_hz,
        progress=None if progress is None else lambda now: progress(now, duration_s),
    )  # fmt: skip
    require_starts(result.ended_by, result.reason)
    assert result.traces is not None
    trace = result.traces[0]
    name = type(skill).__name__ if learned is None else learned.name
    trace.meta.update({"skill": name, "seed": seed, "draws": draws})
    how = (coc, set, seed, duration_s, rate_hz, scores, places)
    typed = "" if learned is None else _command(learned, world, robot, *how)
    if typed:
        trace.meta["command"] = typed
    if not result.success[0]:
        doubts = [text for text in (guess_note(model.spec), resistance_note(model)) if text]
        trace.meta["notes"] = [*trace.meta.get("notes", []), *doubts]
    unscored = None
    if scores:
        try:
            trace.meta["scores"] = score_notes(scores_of(trace, scores))
        except ScoreFailed as error:
            unscored = error
    arms = result.arm_traces[0] if isinstance(result, ArmsResult) and result.arm_traces else {}
    return SingleRun(trace=trace, arms=arms, interrupted=result.interrupted, unscored=unscored)


def _command(
    skill: LearnedSkill, world: World, robot: Robot, coc: str | None, settings: Settings | None, seed: int,
    duration_s: float, rate_hz: float, scores: Sequence[str], places: File | None,
) -> str:  # fmt: skip
    """The command that repeats the run, without its output. "" where Python objects cannot be typed."""
    named = robot if isinstance(robot, str | os.PathLike) else None
    if skill.source is None or named is None or isinstance(world, Scene):
        return ""
    words = ["run", skill.source, "--world", os.fspath(world), "--robot", os.fspath(named)]
    words += [] if coc is None else ["--coc", coc]
    words += [] if places is None else ["--places", os.fspath(places)]
    words += [word for key, value in (settings or {}).items() for word in ("--set", f"{key}={_typed(value)}")]
    words += ["--seed", f"{seed}"]
    words += [] if duration_s == LONGEST_S else ["--duration", f"{duration_s:g}"]
    words += [] if rate_hz == RATE_HZ else ["--rate", f"{rate_hz:g}"]
    return shlex.join(["skillframe", *words, *(word for name in scores for word in ("--score", name))])


def _typed(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
