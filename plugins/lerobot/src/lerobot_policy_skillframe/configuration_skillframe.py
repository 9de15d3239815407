"""`SkillframeConfig`: settings of a skill as a policy of LeRobot.

LeRobot finds policy and processors by names: `modeling_` and `processor_` for this module's `configuration_`, `Policy`
for the class's `Config`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs.policies import PreTrainedConfig
from lerobot.configs.types import FeatureType, PolicyFeature
from skillframe_gym.settings import EnvSettings

from lerobot_policy_skillframe.following import STATE, WRENCH
from skillframe.errors import InputError

OBSERVED_STATE, OBSERVED_WRENCH, ACTION = "observation.state", "observation.wrench", "action"
STATE_OF_ENV = "observation.environment_state"
"""Alternative name of the wrench, the only other vector that LeRobot's own loop passes on."""
NOT_TRAINED = "is no way to learn a skill", "learn it with: skillframe learn DEMONSTRATION ... --out NAME.skill.json"


@PreTrainedConfig.register_subclass("skillframe")
@dataclass
class SkillframeConfig(PreTrainedConfig):  # type: ignore[misc]
    """A skill as a policy.

    Attributes:
        skill: path of the skill file; a saved policy holds it.
        point: of the tool, where state and wrench are observed and the environment's controller acts: a name of the
            file, or "x,y,z" [m].
        coc: centre of compliance, likewise; None as learned.
        rate_hz, reach_m, reach_rad, stiffness, variable_stiffness: those of the environment, as in
            `skillframe_gym.settings.EnvSettings`.
        seed: of random skills.
    """

    input_features: dict[str, PolicyFeature] | None = field(default_factory=dict)
    output_features: dict[str, PolicyFeature] | None = field(default_factory=dict)
    skill: str = ""
    point: str = "tip"
    coc: str | None = None
    rate_hz: float = 20.0
    reach_m: float = 0.02
    reach_rad: float = 0.1
    stiffness: list[float] = field(default_factory=lambda: [1000.0, 50.0])
    variable_stiffness: bool = False
    seed: int = 0
    device: str | None = "cpu"
    push_to_hub: bool = False

    def __post_init__(self) -> None:
        """Fill in missing input and output features.

        Raises:
            InputError: a setting that no environment has.
        """
        super().__post_init__()
        self.settings()
        self.input_features = self.input_features or {
            OBSERVED_STATE: PolicyFeature(type=FeatureType.STATE, shape=(STATE,)),
            OBSERVED_WRENCH: PolicyFeature(type=FeatureType.STATE, shape=(WRENCH,)),
        }
        numbers = 12 if self.variable_stiffness else 6
        self.output_features = self.output_features or {
            ACTION: PolicyFeature(type=FeatureType.ACTION, shape=(numbers,))
        }

    def settings(self) -> EnvSettings:
        """The environment's settings that shape actions."""
        force, torque = self.stiffness if len(self.stiffness) == 2 else (0.0, 0.0)
        return EnvSettings(
            rate_hz=self.rate_hz, reach_m=self.reach_m, reach_rad=self.reach_rad, stiffness=(force, torque),
            variable_stiffness=self.variable_stiffness,
        )  # fmt: skip

    @property
    def observation_delta_indices(self) -> None:
        """Only the present is observed."""
        return None

    @property
    def action_delta_indices(self) -> None:
        """Nothing is trained, so no actions are needed."""
        return None

    @property
    def reward_delta_indices(self) -> None:
        """Nothing is trained, so no rewards are needed."""
        return None

    def get_optimizer_preset(self) -> Any:
        """Refuse.

        Raises:
            InputError: always.
        """
        raise InputError("training by LeRobot", *NOT_TRAINED)

    def get_scheduler_preset(self) -> None:
        """None."""

    def validate_features(self) -> None:
        """Refuse features of another size.

        Raises:
            InputError: the state, the wrench or the action has another size.
        """
        for name, size in ((OBSERVED_STATE, STATE), (OBSERVED_WRENCH, WRENCH)):
            feature = (self.input_features or {}).get(name)
            if feature is not None and tuple(feature.shape) != (size,):
                text = f"has shape {tuple(feature.shape)}, not ({size},)"
                raise InputError(name, text, "give it as skillframe's data sets have it")
