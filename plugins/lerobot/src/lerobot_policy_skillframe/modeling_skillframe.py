"""`SkillframePolicy`: a learned skill as a LeRobot policy.

It has no weights. A saved policy is a folder with `config.json` and the skill file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.policies.pretrained import PreTrainedPolicy
from torch import Tensor

from lerobot_policy_skillframe.configuration_skillframe import (
    NOT_TRAINED,
    OBSERVED_STATE,
    OBSERVED_WRENCH,
    STATE_OF_ENV,
    SkillframeConfig,
)
from lerobot_policy_skillframe.following import Following, Points, read_skill
from skillframe.document import save
from skillframe.errors import InputError
from skillframe.extend import Document
from skillframe.frames import Float

SKILL_FILE = "policy.skill.json"


class SkillframePolicy(PreTrainedPolicy):  # type: ignore[misc]
    """A skill as a policy.

    Args:
        config: with the skill file's path, where no document is given.
        document: the skill file's content, checked.
        given: statistics and metadata of LeRobot's factory, unused.

    Attributes:
        document: the skill.
        following: the skill at the policy's rate, with `status` and `reason`.

    Raises:
        InputError, UnknownName: no skill file, or one that cannot be run.
    """

    config_class = SkillframeConfig
    name = "skillframe"

    def __init__(self, config: SkillframeConfig, *, document: Document | None = None, **given: Any) -> None:
        super().__init__(config)
        config.validate_features()
        self.document = read_skill(config.skill) if document is None else document
        points = Points(observed=config.point, compliant=config.coc)
        self.following = Following(self.document, config.settings(), points, config.seed)

    def reset(self) -> None:
        """Begin a new episode with the next observation."""
        self.following.reset()

    def select_action(self, batch: dict[str, Tensor], **given: Any) -> Tensor:
        """Action (N, 6 or 12) for an observation, as of skillframe's environments.

        Args:
            batch: `observation.state` (N, 7) and `observation.wrench` (N, 6), or (7,) and (6,) of one trial.
            given: ignored.

        Raises:
            InputError: something is missing, or has another size.
        """
        state, wrench = _array(batch, OBSERVED_STATE), _array(batch, OBSERVED_WRENCH, STATE_OF_ENV)
        actions = self.following.act(state, wrench)
        return torch.as_tensor(actions, dtype=torch.float32, device=batch[OBSERVED_STATE].device)

    def predict_action_chunk(self, batch: dict[str, Tensor], **given: Any) -> Tensor:
        """A chunk of one action (N, 1, 6 or 12), since the next depends on the next wrench.

        It advances the skill's clock as `select_action` does.
        """
        return self.select_action(batch, **given)[:, None]

    def forward(self, batch: dict[str, Tensor]) -> Any:
        """Refuse.

        Raises:
            InputError: always.
        """
        raise InputError("training by LeRobot", *NOT_TRAINED)

    def get_optim_params(self) -> Any:
        """Refuse.

        Raises:
            InputError: always.
        """
        raise InputError("training by LeRobot", *NOT_TRAINED)

    def _save_pretrained(self, save_directory: Path) -> None:
        self.config._save_pretrained(save_directory)
        save(self.document, save_directory / SKILL_FILE)

    @classmethod
    def from_pretrained(
        cls, pretrained_name_or_path: str | Path, *, config: SkillframeConfig | None = None, **given: Any
    ) -> SkillframePolicy:
        """A saved policy.

        Args:
            pretrained_name_or_path: its folder; no hub is used.
            config: in place of the saved one.
            given: ignored.

        Raises:
            InputError, UnknownName: no such folder, or its skill file cannot be run.
        """
        folder = Path(pretrained_name_or_path)
        if not folder.is_dir():
            raise InputError(folder, "is no folder of a saved policy", "give one; fetch it from a hub first")
        config = SkillframeConfig.from_pretrained(folder) if config is None else config
        policy = cls(config, document=read_skill(folder / SKILL_FILE))
        policy.eval()
        return policy


def _array(batch: dict[str, Tensor], name: str, *others: str) -> Float:
    """The first available feature of a batch, (N, n)."""
    for each in (name, *others):
        if each in batch:
            values: Float = batch[each].detach().cpu().numpy().astype(float)
            return np.atleast_2d(values)
    raise InputError(name, "is not observed", f"give it; the batch has {', '.join(sorted(batch)) or 'nothing'}")
