"""PPO on the peg's Gymnasium environment beside LMC from two demonstrations, on the same draws with the hole moved.

    python -m tests.figures.reinforcement --steps 61440 --seeds 3 --out reinforcement

The draws are those of `plugins/baselines/comparison/peg_in_hole.toml`: 20 for each of two pairs of demonstrations. PPO
is that of stable-baselines3 with its default settings, observations and rewards scaled by their running deviations,
the environment's own reward, and starts and holes drawn as in the campaign, so it has met what it is tried on. It is
tried without its exploration noise. `down` is no method: it gives one and the same action, a target 10 mm below.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from skillframe_gym.environments import Task, WorldVectorEnv
from skillframe_gym.episodes import Cohort
from skillframe_gym.settings import EnvSettings

from skillframe import learn, record
from skillframe.campaign.sampling import draws, trial_rngs
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.statistics import clopper_pearson
from skillframe.errors import SkillframeError
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.frames import Float

CAMPAIGN = Path(__file__).resolve().parents[2] / "plugins" / "baselines" / "comparison" / "peg_in_hole.toml"
TEACHINGS = (103, 104)  # as in plugins/baselines/tests/test_comparison.py
ENVS, ROLLOUT = 16, 2048  # trials side by side, and steps of all of them between two updates (PPO's own 2048)
LOOKS = (0, 5, 10, 20)  # after how many rollouts PPO is tried, beside the last
TOLD = {
    "success": "is_success", "seconds": "duration_s", "peak": "peak_force_n", "far_m": "final_error_m",
    "failure": "failure",
}  # fmt: skip
Policy = Callable[[dict[str, Float]], Float]
Found = dict[str, list[Any]]


def spec_of(teaching: int) -> CampaignSpec:
    """The campaign of one pair of demonstrations, with the seed that the comparison gives it."""
    table = tomllib.loads(CAMPAIGN.read_text(encoding="utf-8"))
    table |= {"seed": table["seed"] + teaching, "skills": ["straight.skill.json"]}
    return CampaignSpec.from_table(table, CAMPAIGN)


def drawn(spec: CampaignSpec) -> tuple[dict[str, Float], list[np.random.Generator]]:
    """Quantities and generators of all trials, those of the campaign to the last bit."""
    trials = range(spec.trials)
    fixed = {name: np.full(spec.trials, value) for name, value in spec.fixed.items()}
    return {**fixed, **draws(spec, trials)}, trial_rngs(spec.seed, trials)


def tried(policy: Policy) -> Found:
    """A policy of the environment's observations on all draws."""
    found: Found = {name: [] for name in TOLD}
    for teaching in TEACHINGS:
        spec = spec_of(teaching)
        task = Task(spec.world, spec.robot, None, {"duration_s": spec.duration_s})
        cohort = Cohort(task.setup, EnvSettings(duration_s=spec.duration_s), *drawn(spec))
        while not (seen := cohort.see()).ended.all():
            cohort.step(policy(seen.observation))
        for i in range(spec.trials):
            _note(found, *(cohort.told(i)[name] for name in TOLD.values()))
    return found


def taught() -> Found:
    """LMC from its two demonstrations on the same draws, as `skillframe campaign run` runs it."""
    found: Found = {name: [] for name in TOLD}
    for teaching in TEACHINGS:
        spec = spec_of(teaching)
        shown = record(spec.world, spec.robot, count=2, seed=teaching).demonstrations
        robot, scene = load_robot_model(spec.robot), load_world(spec.world, {})
        skill, setup = prepare(robot, scene, learn(shown).document, spec.coc)
        given, rngs = drawn(spec)
        result = simulate(skill, setup, given, rngs, duration_s=spec.duration_s)
        for i in range(spec.trials):
            seconds, peak, far = (float(a[i]) for a in (result.duration_s, result.peak_force_n, result.final_error_m))
            _note(found, bool(result.success[i]), seconds, peak, far, str(result.failure[i]))
    return found


def _note(found: Found, *values: Any) -> None:
    for name, value in zip(found, values, strict=True):
        found[name].append(value)


class AtOnce(WorldVectorEnv):
    """Trials that ended begin again in the same step, as stable-baselines3 wants it. `last` is what they showed."""

    def step(self, actions: Any) -> Any:
        """As `WorldVectorEnv`, but what is returned of a trial that ended is the start of the next."""
        self.last, reward, ended, late, infos = super().step(actions)
        if self._over.any():
            self._begin(np.flatnonzero(self._over))
            self._over = np.zeros(self.num_envs, dtype=bool)
        return self._copied(), reward, ended, late, infos


def training_env(seed: int) -> Any:
    """The environments of stable-baselines3, drawn as the campaign's trials, scaled by running deviations."""
    from stable_baselines3.common.vec_env import VecEnv, VecNormalize

    spec = spec_of(TEACHINGS[0])
    vary = {name: {axis.kind: list(axis.numbers)} for name, axis in spec.vary.items()}
    many = AtOnce(ENVS, spec.world, spec.robot, set=spec.fixed, vary=vary, starts="nominal")

    class Adapter(VecEnv):  # type: ignore[misc]
        """What stable-baselines3 asks of a vector environment."""

        def __init__(self) -> None:
            super().__init__(ENVS, many.single_observation_space, many.single_action_space)

        def reset(self) -> Any:
            return many.reset(seed=1000 * seed)[0]

        def step_async(self, actions: Any) -> None:
            self.given = actions

        def step_wait(self) -> Any:
            shown, reward, ended, late, _ = many.step(self.given)
            infos: list[dict[str, Any]] = [{} for _ in range(ENVS)]
            for i in np.flatnonzero(ended | late):
                last = {name: values[i] for name, values in many.last.items()}
                infos[i] = {"terminal_observation": last, "TimeLimit.truncated": bool(late[i] and not ended[i])}
            return shown, reward.astype(np.float32), ended | late, infos

        def close(self) -> None: ...

        def get_attr(self, name: str, indices: Any = None) -> list[Any]:
            return [getattr(self, name, None)] * ENVS

        def set_attr(self, name: str, value: Any, indices: Any = None) -> None:
            raise NotImplementedError

        def env_method(self, name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
            raise NotImplementedError

        def env_is_wrapped(self, wrapper: Any, indices: Any = None) -> list[bool]:
            return [False] * ENVS

    return VecNormalize(Adapter())


def trained(seed: int, steps: int) -> list[dict[str, Any]]:
    """PPO of one seed, tried after some rollouts and after the last: steps, CPU seconds and what was found."""
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)
    env = training_env(seed)
    model = PPO("MultiInputPolicy", env, n_steps=ROLLOUT // ENVS, seed=seed, device="cpu")

    def policy(observation: dict[str, Float]) -> Float:
        actions, _ = model.predict(env.normalize_obs(observation), deterministic=True)
        result: Float = actions
        return result

    rows, spent, rollouts = [], 0.0, -(-steps // ROLLOUT)
    for look in sorted({*(n for n in LOOKS if n < rollouts), rollouts}):
        began = time.process_time()
        if left := look * ROLLOUT - model.num_timesteps:
            model.learn(left, reset_num_timesteps=model.num_timesteps == 0)
        spent += time.process_time() - began
        rows.append({"seed": seed, "steps": model.num_timesteps, "cpu_s": spent, **tried(policy)})
        print(line(f"PPO, seed {seed}, {model.num_timesteps} steps, {spent / 60:.1f} CPU min", rows[-1]), flush=True)
    return rows


def line(name: str, found: dict[str, Any]) -> str:
    """A row of the table."""
    good = np.array(found["success"])
    low, high = clopper_pearson(int(good.sum()), len(good))
    peak, seconds = np.array(found["peak"]), np.array(found["seconds"])[good]
    time_s = f"{np.median(seconds):.1f} s" if len(seconds) else "-"
    return f"| {name} | {good.sum()} of {len(good)} | {low:.2f} - {high:.2f} | {time_s} | {np.median(peak):.0f} N |"


def down(observation: dict[str, Float]) -> Float:
    """The same action whatever is seen: half of the reach downwards, 10 N."""
    return np.tile([0.0, 0.0, -0.5, 0.0, 0.0, 0.0], (len(observation["wrench"]), 1))


def main(given: Sequence[str]) -> None:
    """Print the table and write what was found of every trial."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=61440, help="of a seed's training, rounded up to whole rollouts")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(given)
    try:
        import stable_baselines3  # noqa: F401
    except ImportError:
        sys.exit("stable_baselines3 is not installed, which trains PPO; type: pip install stable-baselines3")
    if args.out.exists():
        raise SkillframeError(f"{args.out} is there already; choose another name, or remove it")
    args.out.mkdir(parents=True)
    print("| method | success | 95 % interval | median time of a success | median peak force |\n|---|---|---|---|---|")
    found: dict[str, Any] = {"lmc": taught(), "down": tried(down)}
    for name, label in (("lmc", "LMC, two demonstrations"), ("down", "one action, 10 N downwards")):
        print(line(label, found[name]), flush=True)
    for seed in range(1, args.seeds + 1):
        found[f"ppo {seed}"] = trained(seed, args.steps)
        (args.out / "found.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
