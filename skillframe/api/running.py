"""`run` and `SingleRun`: one run of a skill in a world, and what became of it."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from skillframe.api.inputs import File
from skillframe.api.learning import LearnedSkill, Skills, skill_of
from skillframe.api.tasks import Robot, Settings, World, robot_of, scene_of
from skillframe.config.of_runs import DURATION, TRACE_RATE
from skillframe.demonstration.places import load_places
from skillframe.demonstration.record import resolve_point
from skillframe.errors import InputError, SkillframeError
from skillframe.execution.arms import ArmsResult
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import drive_maker, prepare
from skillframe.execution.scores import ScoreFailed, about, score_notes, scores_of
from skillframe.execution.trace import Trace
from skillframe.files import write_whole
from skillframe.robot.guesses import guess_note
from skillframe.robot.model import RobotModel
from skillframe.robot.resistance import resistance_note
from skillframe.skill import Skill
from skillframe.world.scene import Scene

LONGEST_S, RATE_HZ = DURATION.default, TRACE_RATE.default
"""Longest run [s] and rate of the trace [Hz] where nothing else is said; our choice."""
PICTURE = (960, 720)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class SingleRun:
    """One run.

    Attributes:
        trace: everything over time, and in `meta` the outcome and the scene's geometry.
        arms: of a run with two arms, every arm's trace by its name; else empty.
        interrupted: Ctrl-C came before the end.
        unscored: the error of a score that failed; the run itself is whole.
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
        """Why not, in words. "" for a success."""
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
        """Peak contact force [N]: the largest of one control tick in the simulator."""
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
        """The scores that were asked for, by name, in SI units. None where this run has no such figure."""
        return {name: about["value"] for name, about in (self.trace.meta.get("scores") or {}).items() if about}

    @property
    def events(self) -> list[tuple[float, str]]:
        """What happened when [s], in words: phases that began, parts that failed."""
        return [(float(when), str(what)) for when, what in self.trace.meta.get("events") or []]

    def save(self, path: File) -> SingleRun:
        """Write the trace (.npz), whole or not at all.

        Raises:
            InputError: the file cannot be written.
        """
        self.trace.save(Path(path))
        return self

    def replay(self, out: File) -> Path:
        """Write a page with a 3-D replay and plots (.html).

        Raises:
            InputError: the file cannot be written.
        """
        from skillframe.reports.page import write_report

        with TemporaryDirectory() as folder:
            file = Path(folder) / f"{Path(out).stem}.npz"
            self.trace.save(file)
            write_report([file], Path(out))
        return Path(out)

    def video(self, out: File, progress: Callable[[float, float], None] | None = None) -> Path:
        """Write a video (.mp4).

        Args:
            out: the file.
            progress: called after each frame with how many of how many are done.

        Raises:
            InputError: the file's name is not one of a video, or it cannot be written.
        """
        from skillframe.reports.video import write_film

        write_film(self.trace, Path(out), progress or (lambda done, total: None))
        return Path(out)

    def picture(self, out: File, time: float | None = None, *, far: bool = False) -> Path:
        """Write a still of the scene (.png): the tool and the fixture near its tip, cut open.

        Args:
            out: the file.
            time: of the run [s]; None for its end.
            far: the whole scene instead.

        Raises:
            InputError: the trace holds no geometry, or the file cannot be written.
        """
        from skillframe.reports.raster import over_paper, png
        from skillframe.reports.runs import still
        from skillframe.reports.stage import stage_of

        stage = stage_of(self.trace)
        if stage is None:
            raise InputError(out, "cannot be drawn: the trace holds no geometry", "run again")
        last = len(self.trace.time) - 1
        frame = last if time is None else min(int(np.searchsorted(self.trace.time, time)), last)
        image = over_paper(still(stage, frame, stage.far if far else stage.close, *PICTURE))
        write_whole(Path(out), png(np.concatenate([image, np.full((*image.shape[:2], 1), 255, np.uint8)], axis=-1)))
        return Path(out)

    def __repr__(self) -> str:
        meta, said = self.trace.meta, "success" if self.success else f"failure: {self.failure}"
        what = f"{meta.get('skill')} by {meta['robot']} in {meta['world']}"
        return (
            f"SingleRun({what}: {said}; {self.duration_s:.2f} s, peak force in the simulator {self.peak_force_n:.1f} N)"
        )


def run(
    skill: Skills | Skill, world: World, robot: Robot = "panda", *, coc: str | None = None,
    set: Settings | None = None, seed: int = 0, duration_s: float = LONGEST_S, rate_hz: float = RATE_HZ,
    scores: Sequence[str] = (), progress: Callable[[float, float], None] | None = None,
    places: File | None = None,
) -> SingleRun:  # fmt: skip
    """Run a skill once in a simulated world.

    Args:
        skill: what `learn` gave, a skill file, "TYPE:DEMONSTRATION", a document, or an object that steps itself.
        world: a name, a fixture file, or a scene of your own.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        coc: centre of compliance, "x,y,z" [m] in the tool frame or a frame's name; None as learned.
        set: what differs from the nominal, {"start.offset_x": 0.008, "fixture.tilt_y": "5deg"}.
        seed: of the sensor noise.
        duration_s: longest run [simulated s].
        rate_hz: of the trace.
        scores: names of figures that plug-ins compute from the trace.
        progress: called with seconds simulated and the longest duration.
        places: TOML file with poses of places in base, for a skill that goes by places; None: as the world says.

    Raises:
        SkillframeError: something given cannot be used, or a score failed; says what, where, and what to do.
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
    """As `run`, but a run that Ctrl-C ended, or whose scores failed, is given back as it stood."""
    for each in scores:
        about(each)  # an unknown one is told before the run
    scene, draws = scene_of(world, set, depth=3)
    own = skill if isinstance(skill, Skill) else None
    learned = None if isinstance(skill, Skill) else skill_of(skill)
    model = robot_of(robot)
    if own is not None:
        runnable, setup = own, _setup(model, scene, coc)
    else:
        assert learned is not None
        told = None if places is None else load_places(Path(places))
        runnable, setup = prepare(model, scene, learned.document, coc, told)
    result = simulate(
        runnable, setup, {key: np.array([value]) for key, value in draws.items()}, [np.random.default_rng(seed)],
        duration_s=duration_s, trace_hz=rate_hz,
        progress=None if progress is None else lambda now: progress(now, duration_s),
    )  # fmt: skip
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
    arms = result.arm_traces[0] if isinstance(result, ArmsResult) and result.arm_traces else {}
    return SingleRun(trace=trace, arms=arms, interrupted=result.interrupted, unscored=_score(trace, scores))


def _score(trace: Trace, names: Sequence[str]) -> SkillframeError | None:
    """Put the scores into the trace's metadata. The error of one that fails."""
    if names:
        try:
            trace.meta["scores"] = score_notes(scores_of(trace, names))
        except ScoreFailed as error:
            return error
    return None


def _setup(robot: RobotModel, scene: Scene, coc: str | None) -> Setup:
    """The set-up of a skill that steps itself. It says nothing of where it was learned."""
    center = resolve_point(coc, scene.tool.frames)
    return Setup(robot=robot, scene=scene, center_of_compliance=center, make_drive=drive_maker(robot))


def _command(
    skill: LearnedSkill, world: World, robot: Robot, coc: str | None, settings: Settings | None, seed: int,
    duration_s: float, rate_hz: float, scores: Sequence[str], places: File | None,
) -> str:  # fmt: skip
    """What to type to get the same run again, without where it goes. "" where objects of Python cannot be typed."""
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
