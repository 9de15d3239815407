"""A skill inside LeRobot: found by its name, made by LeRobot's factories, saved, loaded, and run by LeRobot's loop."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lerobot", reason="lerobot is not installed; make test-lerobot does it")
pytest.importorskip("torch", reason="torch is not installed; make test-lerobot installs it")

import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env, make_env_pre_post_processors
from lerobot.policies.factory import make_policy, make_pre_post_processors
from lerobot.scripts.lerobot_eval import eval_policy_all, main
from lerobot.utils.import_utils import register_third_party_plugins
from lerobot_policy_skillframe import SkillframePolicy

from skillframe.errors import InputError

SKILL = "plugins/baselines/comparison/straight.skill.json"
register_third_party_plugins()


@pytest.fixture
def env():
    """LeRobot's own configuration of the peg's world, the cheapest robot."""
    settings = {"robot": "free_tool", "starts": "nominal"}
    return EnvConfig.get_choice_class("skillframe")(episode_length=160, settings=settings)


@pytest.fixture
def config():
    return PreTrainedConfig.get_choice_class("skillframe")(skill=SKILL, coc="tip")


@pytest.fixture
def batch():
    state = torch.tensor([[0.4, 0.1, 0.3, 1.0, 0.0, 0.0, 0.0]])
    return {"observation.state": state, "observation.wrench": torch.zeros(1, 6)}


def test_lerobot_finds_the_policy_and_the_worlds_by_the_name_of_the_distribution():
    assert "skillframe" in PreTrainedConfig.get_known_choices() and "skillframe" in EnvConfig.get_known_choices()


def test_a_saved_policy_holds_the_skill_and_acts_as_the_one_that_was_saved(config, env, batch, tmp_path):
    first = make_policy(config, env_cfg=env)
    skill = tmp_path / "elsewhere.skill.json"
    shutil.copy(SKILL, skill)
    saved, folder = make_policy(type(config)(skill=str(skill), coc="tip"), env_cfg=env), tmp_path / "saved"
    saved.save_pretrained(folder)
    skill.unlink()
    loaded = PreTrainedConfig.from_pretrained(folder)
    loaded.pretrained_path = Path(folder)
    second = make_policy(loaded, env_cfg=env)
    assert second.document == first.document and second.config.coc == "tip"
    for _ in range(3):
        one, other = first.select_action(batch), second.predict_action_chunk(batch)
        assert one.shape == (1, 6) and torch.equal(one, other[:, 0]) and one.dtype == torch.float32
    assert one[0, 2] == pytest.approx(-0.1, abs=1e-4)  # 2 mm ahead at 1000 N/m, of 20 N


def test_lerobot_does_not_train_it(config, env, batch):
    policy = make_policy(config, env_cfg=env)
    for refused in (lambda: policy.forward(batch), policy.get_optim_params, config.get_optimizer_preset):
        with pytest.raises(InputError, match="skillframe learn"):
            refused()


def test_what_is_not_observed_or_of_another_size_is_named(config, env, batch):
    policy = make_policy(config, env_cfg=env)
    with pytest.raises(InputError, match=r"observation\.wrench.*is not observed"):
        policy.select_action({"observation.state": batch["observation.state"]})
    wrong = type(config)(skill=SKILL)
    wrong.input_features["observation.state"].shape = (6,)
    with pytest.raises(InputError, match=r"shape \(6,\), not \(7,\)"):
        make_policy(wrong, env_cfg=env)


def test_lerobot_s_own_loop_inserts_the_peg(config, env, tmp_path):
    policy = make_policy(config, env_cfg=env)
    for part in make_pre_post_processors(config):
        part.save_pretrained(tmp_path)
    before, behind = make_pre_post_processors(config, pretrained_path=str(tmp_path))
    first, last = make_env_pre_post_processors(env, config)
    found = eval_policy_all(
        envs=make_env(env, n_envs=2), policy=policy, env_preprocessor=first, env_postprocessor=last,
        preprocessor=before, postprocessor=behind, n_episodes=2, start_seed=1,
    )  # fmt: skip
    assert found["overall"]["pc_success"] == 100.0 and found["overall"]["n_episodes"] == 2
    assert np.isfinite(found["overall"]["avg_sum_reward"])


def test_lerobot_s_own_program_runs_a_saved_policy_and_films_it(config, tmp_path, monkeypatch):
    for part in (SkillframePolicy(config), *make_pre_post_processors(config)):
        part.save_pretrained(tmp_path / "saved")
    given = {
        "policy.path": tmp_path / "saved", "env.type": "skillframe", "env.settings": "{robot: free_tool}",
        "env.episode_length": 5, "eval.n_episodes": 1, "eval.batch_size": 1, "output_dir": tmp_path / "out",
    }  # fmt: skip
    monkeypatch.setattr("sys.argv", ["lerobot-eval", *(f"--{name}={value}" for name, value in given.items())])
    main()
    told = json.loads((tmp_path / "out" / "eval_info.json").read_text())
    assert told["overall"]["n_episodes"] == 1 and len(list(tmp_path.glob("out/videos/*/*.mp4"))) == 1
