"""`WorldEnv` and `WorldVectorEnv`: a world as a Gymnasium environment, one trial or a batch.

With d the distance to the world's goal, 1 rad counted as 0.1 m, a step's reward is

    progress:  (d_before - d_after) / 10 mm  + 10 if the trial succeeded, - 10 if it ended otherwise but by the clock
    sparse:    1 if the trial succeeded, else 0

The first is a difference of a potential (Ng, Harada and Russell 1999, gamma = 1) plus the value of the end. Success and
failure are those of `run`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from skillframe.api import Robot, Settings, World, robot_of, scene_of
from skillframe.demonstration import resolve_point
from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.execution import Setup
from skillframe.frames import Float
from skillframe_gym.episodes import Cohort, Seen
from skillframe_gym.pictures import Camera
from skillframe_gym.settings import EnvSettings, observation_space

SCALE_M, WORTH = 0.01, 10.0
Obs = dict[str, Float]


class Task:
    """A world with its robot, from which cohorts of trials are made.

    Args:
        world: a name, a fixture file, or a scene.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        set: deviations from the nominal in every trial, as with `run`.
        settings: fields of `EnvSettings`.
    """

    def __init__(self, world: World, robot: Robot, set: Settings | None, settings: dict[str, Any]) -> None:
        try:
            self.settings = EnvSettings(**settings)
        except TypeError as error:
            raise InputError("environment", str(error).partition("() ")[2], "see EnvSettings") from None
        self.scene, self._fixed = scene_of(world, set, depth=4)
        model = robot_of(robot)
        point = np.zeros(3) if model.spec.own_law else resolve_point("tip", self.scene.tool.frames)
        self.setup = Setup(
            robot=model, scene=self.scene, center_of_compliance=point,
            stop_when=self.scene.goal,
        )  # fmt: skip
        self._axes = self.settings.axes

    def begin(self, rngs: Sequence[np.random.Generator]) -> Cohort:
        """Trials at their starts, each with a child of its environment's generator, so that none affects another."""
        children = [rng.spawn(2) for (rng,) in ([parent.spawn(1)[0]] for parent in rngs)]
        drawn = [self._drawn(first) for first, _ in children]
        names = sorted({name for trial in drawn for name in trial})
        draws = {name: np.array([float(trial.get(name, 0.0)) for trial in drawn]) for name in names}
        return Cohort(self.setup, self.settings, draws, [second for _, second in children])

    def _drawn(self, rng: np.random.Generator) -> dict[str, Any]:
        """Quantities of one trial: fixed ones over sampled ones over the start."""
        starts = self.scene.task.starts if self.settings.starts == "task" else ({},)
        start = starts[int(rng.integers(len(starts)))]
        return {**start, **{name: axis.draw(rng) for name, axis in self._axes.items()}, **self._fixed}

    def reward(self, before: Float, seen: Seen) -> Float:
        """(N,) reward of a step from distances `before` (N,) to `seen`."""
        if self.settings.reward == "sparse":
            return seen.success.astype(float)
        worth = WORTH * (seen.success.astype(float) - (seen.ended & ~seen.success & ~seen.by_time))
        return np.nan_to_num((before - seen.distance) / SCALE_M) + worth


class WorldEnv(gymnasium.Env[Obs, NDArray[np.float32]]):
    """One trial at a time.

    Args:
        world: a name, a fixture file, or a scene.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        set: deviations from the nominal in every trial, {"world.friction": 0.2}, as with `run`.
        render_mode: "rgb_array": `render` draws the tool over the fixture cut open; None: nothing is drawn.
        settings: fields of `EnvSettings`.

    Raises:
        SkillframeError: an argument cannot be used.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012  (Gymnasium's own form)

    def __init__(
        self, world: World, robot: Robot = "panda", *, set: Settings | None = None, render_mode: str | None = None,
        **settings: Any,
    ) -> None:  # fmt: skip
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UnknownName("render_mode", str(render_mode), self.metadata["render_modes"])
        self.task = Task(world, robot, set, settings)
        self.action_space: Any = self.task.settings.action_space()
        self.observation_space: Any = observation_space()
        self.render_mode = render_mode
        self._cohort: Cohort | None = None
        self._camera: Camera | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Obs, dict[str, Any]]:
        """Begin the next trial, without `options`.

        Raises:
            InputError: it begins in collision. The ranges of the settings apply, so it is not sampled again.
        """
        super().reset(seed=seed)
        self._cohort, self._camera = self.task.begin([self.np_random]), None
        self._seen = self._cohort.see()
        self._told = False
        return _row(self._seen, 0), {}

    def step(self, action: NDArray[np.float32]) -> tuple[Obs, float, bool, bool, dict[str, Any]]:
        """Tick to the next action.

        Raises:
            SkillframeError: there is no trial, or it is over.
            InputError: an action that is not finite.
        """
        if self._cohort is None or self._told:
            raise SkillframeError("the episode is over or was not begun; call reset() first")
        before = self._seen.distance
        self._cohort.step(np.asarray(action)[None])
        self._seen = seen = self._cohort.see()
        self._told = bool(seen.ended[0])
        info = self._cohort.told(0) if self._told else {}
        late = bool(seen.by_time[0])
        return _row(seen, 0), float(self.task.reward(before, seen)[0]), self._told and not late, late, info

    def render(self) -> Any:
        """Picture (240, 320, 3) of the trial if `render_mode` is "rgb_array", else None.

        Raises:
            SkillframeError: there is no trial.
        """
        if self.render_mode is None:
            return None
        if self._cohort is None:
            raise SkillframeError("no episode was begun; call reset() first")
        tip = self._cohort.tip(0)
        self._camera = self._camera or Camera(self.task.scene, tip)
        return self._camera.picture(tip)


class WorldVectorEnv(VectorEnv[Obs, NDArray[np.float32], NDArray[Any]]):
    """N trials in one batch, each bitwise equal to a `WorldEnv` of its own seed.

    An ended trial restarts in the next step and ignores its action (Gymnasium's `NEXT_STEP`). Trials that begin
    together form a batch; spread starts make batches smaller.

    Args:
        num_envs: N.
        world, robot, set, render_mode, settings: as of `WorldEnv`.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self, num_envs: int, world: World, robot: Robot = "panda", *, set: Settings | None = None,
        render_mode: None = None, **settings: Any,
    ) -> None:  # fmt: skip
        self.task, self.num_envs, self.render_mode = Task(world, robot, set, settings), num_envs, render_mode
        self.single_action_space, self.single_observation_space = self.task.settings.action_space(), observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs: list[np.random.Generator] = []

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Obs, dict[str, Any]]:
        """Begin N trials, with seeds s, s + 1, ... as in Gymnasium's vector environments."""
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        if seeds is not None and len(seeds) != self.num_envs:
            raise InputError("seed", f"holds {len(seeds)} seeds for {self.num_envs} trials", "give one for each")
        asked = seeds if seeds is not None else [None] * self.num_envs
        kept = self._rngs or [np.random.default_rng() for _ in asked]
        self._rngs = [old if s is None else np.random.default_rng(s) for s, old in zip(asked, kept, strict=True)]
        self._groups: list[_Group] = []
        self._over, self._distance = np.zeros(self.num_envs, dtype=bool), np.zeros(self.num_envs)
        spaces = observation_space().spaces
        self._observed = {name: np.zeros((self.num_envs, *(space.shape or ()))) for name, space in spaces.items()}
        self._begin(np.arange(self.num_envs))
        return self._copied(), {}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Obs, Float, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:  # fmt: skip
        """Tick all trials to their next action, and restart those that had ended.

        Raises:
            SkillframeError: no trial was begun.
            InputError: an action that is not finite.
        """
        if not self._rngs:
            raise SkillframeError("no episode was begun; call reset() first")
        again, reward, infos = np.flatnonzero(self._over), np.zeros(self.num_envs), dict[str, Any]()
        ended, late = np.zeros(self.num_envs, dtype=bool), np.zeros(self.num_envs, dtype=bool)
        for rows, cohort, live in self._groups:
            cohort.step(np.asarray(actions)[rows])
            seen, own = cohort.see(), rows[live]
            reward[own] = self.task.reward(self._distance[rows], seen)[live]
            ended[own], late[own] = seen.ended[live], seen.by_time[live]
            self._put(own, seen, live)
            for i in np.flatnonzero(live & seen.ended):
                infos = self._add_info(infos, cohort.told(int(i)), int(rows[i]))
            live &= ~seen.ended
        self._groups, self._over = [group for group in self._groups if group.live.any()], ended
        if len(again):
            self._begin(again)
        return self._copied(), reward, ended & ~late, late, infos

    def _begin(self, rows: NDArray[np.int64]) -> None:
        live = np.ones(len(rows), dtype=bool)
        group = _Group(rows, self.task.begin([self._rngs[i] for i in rows]), live)
        self._groups.append(group)
        self._put(rows, group.cohort.see(), live)

    def _put(self, rows: NDArray[np.int64], seen: Seen, live: NDArray[np.bool_]) -> None:
        self._distance[rows] = seen.distance[live]
        for name, values in seen.observation.items():
            self._observed[name][rows] = values[live]

    def _copied(self) -> Obs:
        return {name: values.copy() for name, values in self._observed.items()}


class _Group(NamedTuple):
    """Trials of one batch, their rows, and which ends are not yet reported."""

    rows: NDArray[np.int64]
    cohort: Cohort
    live: NDArray[np.bool_]


def _row(seen: Seen, i: int) -> Obs:
    return {name: values[i].copy() for name, values in seen.observation.items()}
