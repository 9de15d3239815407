"""skillframe's worlds as LeRobot's environments, for `make_env` and `make_policy`.

LeRobot's loop passes on two vectors: `agent_pos`, which becomes `observation.state` (the pose), and `environment_state`
(the wrench).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
import skillframe_gym
from gymnasium import spaces
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from numpy.typing import NDArray
from skillframe_gym.environments import WorldEnv

from lerobot_policy_skillframe.configuration_skillframe import ACTION, OBSERVED_STATE, STATE_OF_ENV
from lerobot_policy_skillframe.following import STATE, WRENCH

NAMESPACE = "skillframe_lerobot"
Vectors = dict[str, NDArray[np.float32]]


@EnvConfig.register_subclass("skillframe")
@dataclass
class SkillframeEnv(EnvConfig):  # type: ignore[misc]
    """A world as an environment of LeRobot.

    Attributes:
        task: "WORLD-v0".
        fps: actions a second.
        episode_length: most actions of an episode.
        settings: other arguments of `skillframe_gym.environments.WorldEnv`: robot, set, vary, starts ...
    """

    task: str | None = "peg_in_hole-v0"
    fps: int = 20
    episode_length: int = 400
    settings: dict[str, Any] = field(default_factory=dict)
    features: dict[str, PolicyFeature] = field(
        default_factory=lambda: {
            ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(6,)),
            "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(STATE,)),
            "environment_state": PolicyFeature(type=FeatureType.ENV, shape=(WRENCH,)),
        }
    )
    features_map: dict[str, str] = field(
        default_factory=lambda: {
            ACTION: ACTION, "agent_pos": OBSERVED_STATE, "environment_state": STATE_OF_ENV,
        }
    )  # fmt: skip

    @property
    def package_name(self) -> str:
        """Namespace of the environments' names."""
        return NAMESPACE

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of `gymnasium.make`."""
        most = {"max_episode_steps": self.episode_length, "duration_s": self.episode_length / self.fps}
        return {**most, "rate_hz": float(self.fps), "render_mode": "rgb_array", **self.settings}


class Renamed(gymnasium.ObservationWrapper[Any, Any, Any]):
    """A world with pose and wrench under LeRobot's names, as float32."""

    metadata = WorldEnv.metadata

    def __init__(self, **settings: Any) -> None:
        super().__init__(WorldEnv(**settings))
        self.observation_space = spaces.Dict({
            "agent_pos": spaces.Box(-np.inf, np.inf, (STATE,), np.float32),
            "environment_state": spaces.Box(-np.inf, np.inf, (WRENCH,), np.float32),
        })  # fmt: skip

    def observation(self, observation: Any) -> Vectors:
        """Pose and wrench."""
        pose = np.concatenate([observation["position"], observation["quaternion"]])
        return {"agent_pos": pose.astype(np.float32), "environment_state": observation["wrench"].astype(np.float32)}


def _register() -> None:
    for name in skillframe_gym.names():
        ours = f"{NAMESPACE}/{name.partition('/')[2]}"
        if ours not in gymnasium.registry:
            kwargs = gymnasium.spec(name).kwargs
            gymnasium.register(id=ours, entry_point="lerobot_policy_skillframe.environments:Renamed", kwargs=kwargs)


_register()
