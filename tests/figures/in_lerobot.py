"""A learned peg skill as LeRobot's policy beside the same skill in skillframe's own loop, on the same draws.

    .venv-lerobot/bin/python tests/figures/in_lerobot.py

`make test-lerobot` makes that environment. By its path, since a library of LeRobot's is installed as `tests` too. Two
demonstrations are recorded and learned, for each of two seeds. The policy is made by LeRobot's factory from a saved
folder, the world by LeRobot's `make_env`, and LeRobot's own loop runs an episode for each of the 20 draws of
`plugins/baselines/comparison/peg_in_hole.toml` with the hole moved. The noise of the sensor is another one.
"""

from __future__ import annotations

import logging
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from reinforcement import TEACHINGS, TOLD, Found, line, spec_of, taught

from skillframe import learn, record
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec


def saved(spec: CampaignSpec, teaching: int, folder: Path) -> Any:
    """LeRobot's configuration of a policy that was learned and saved in a folder."""
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.policies.factory import make_pre_post_processors
    from lerobot_policy_skillframe import SkillframeConfig, SkillframePolicy

    shown = record(spec.world, spec.robot, count=2, seed=teaching).demonstrations
    learn(shown).save(folder / "peg.skill.json")
    config = SkillframeConfig(skill=str(folder / "peg.skill.json"), coc=spec.coc)
    for part in (SkillframePolicy(config), *make_pre_post_processors(config)):
        part.save_pretrained(folder / "saved")
    loaded = PreTrainedConfig.from_pretrained(folder / "saved")
    loaded.pretrained_path = folder / "saved"
    return loaded


def ran(spec: CampaignSpec, config: Any) -> Found:
    """An episode of LeRobot's loop for each draw of a campaign."""
    from lerobot.envs.configs import EnvConfig
    from lerobot.envs.factory import make_env, make_env_pre_post_processors
    from lerobot.policies.factory import make_policy, make_pre_post_processors
    from lerobot.scripts.lerobot_eval import rollout

    found: Found = {name: [] for name in TOLD}
    drawn = draws(spec, range(spec.trials))
    for trial in range(spec.trials):
        here = {**spec.fixed, **{name: float(values[trial]) for name, values in drawn.items()}}
        settings = {"robot": spec.robot, "set": here, "starts": "nominal"}
        env = EnvConfig.get_choice_class("skillframe")(episode_length=round(20 * spec.duration_s), settings=settings)
        policy = make_policy(config, env_cfg=env)
        before, behind = make_pre_post_processors(config, pretrained_path=str(config.pretrained_path))
        world = make_env(env)["skillframe"][0]
        ends: list[dict[str, Any]] = []
        world.step = watched(world.step, ends)
        done = rollout(world, policy, *make_env_pre_post_processors(env, config), before, behind, seeds=[trial])
        assert len(ends) == 1 and bool(done["success"].any()) == bool(ends[0]["is_success"][0])
        for name, told in TOLD.items():
            found[name].append(ends[0][told][0].item() if told != "failure" else str(ends[0][told][0]))
    return found


def watched(step: Callable[[Any], Any], ends: list[dict[str, Any]]) -> Callable[[Any], Any]:
    """A step of a vector environment that keeps what is told at the end of an episode."""

    def watching(actions: Any) -> Any:
        seen = step(actions)
        if "final_info" in seen[-1]:
            ends.append(seen[-1]["final_info"])
        return seen

    return watching


def main() -> None:
    """Print both rows of the table."""
    try:
        import lerobot_policy_skillframe  # noqa: F401
        from lerobot.utils.import_utils import register_third_party_plugins
    except ImportError:
        sys.exit("lerobot or lerobot_policy_skillframe is not installed; type: make test-lerobot")
    logging.disable(logging.WARNING)
    register_third_party_plugins()
    found: Found = {name: [] for name in TOLD}
    for teaching in TEACHINGS:
        spec = spec_of(teaching)
        with tempfile.TemporaryDirectory() as folder:
            rows = ran(spec, saved(spec, teaching, Path(folder)))
        for name, values in rows.items():
            found[name] += values
    print("| where | success | 95 % interval | median time of a success | median peak force |\n|---|---|---|---|---|")
    print(line("`skillframe campaign run`", taught()))
    print(line("LeRobot's loop", found))


if __name__ == "__main__":
    main()
