"""skillframe's worlds as Gymnasium environments.

    import gymnasium, skillframe_gym
    env = gymnasium.make("skillframe/peg_in_hole-v0")

The import registers `skillframe/WORLD-v0` for every installed world.
"""

from __future__ import annotations

import gymnasium

from skillframe.extend import registry
from skillframe_gym.settings import ROBOTS

__all__ = ["NAMESPACE", "names"]

NAMESPACE = "skillframe"


def names() -> list[str]:
    """Names of the environments, "skillframe/peg_in_hole-v0" ..."""
    return [f"{NAMESPACE}/{world}-v0" for world in registry().names("world")]


def _register() -> None:
    for name, world in zip(names(), registry().names("world"), strict=True):
        if name not in gymnasium.registry:
            robot = {"robot": ROBOTS[world]} if world in ROBOTS else {}
            gymnasium.register(
                id=name,
                entry_point="skillframe_gym.environments:WorldEnv",
                vector_entry_point="skillframe_gym.environments:WorldVectorEnv",
                kwargs={"world": world, **robot},
            )


_register()
