"""skillframe's skills as a policy of LeRobot, which imports this package by its name's prefix.

`following` makes actions of a skill without LeRobot. `configuration_skillframe`, `modeling_skillframe` and
`processor_skillframe` have the names that LeRobot expects, `environments` the worlds under its names.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

__all__ = ["SkillframeConfig", "SkillframeEnv", "SkillframePolicy", "make_skillframe_pre_post_processors"]

_HOMES = {
    "SkillframeConfig": "configuration_skillframe",
    "SkillframeEnv": "environments",
    "SkillframePolicy": "modeling_skillframe",
    "make_skillframe_pre_post_processors": "processor_skillframe",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


if find_spec("lerobot") is not None:  # registers the policy and the environments
    import_module(f"{__name__}.configuration_skillframe")
    import_module(f"{__name__}.environments")
