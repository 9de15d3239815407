"""Short ways to run a push in a shipped world, for tests of the loop. Robots and scenes are loaded once."""

from dataclasses import replace
from functools import cache

import numpy as np
from skillframe_worlds.hooks import skillframe_worlds as world_types

from skillframe.execution.executor import Setup, simulate
from skillframe.extend import make_scene
from skillframe.robot.model import load_model
from skillframe.robot.spec import Limits, load_robot
from skillframe.world.quantities import SensorSettings

SILENT = SensorSettings(
    force_noise=0.0, torque_noise=0.0, force_bias=0.0, torque_bias=0.0, position_noise=0.0, rotation_noise=0.0
)
UNLIMITED = Limits(force_n=None, torque_rate_nm_s=None)


@cache
def robot(name, limits=UNLIMITED):
    """A shipped robot under some limits, by default none."""
    model = load_model(load_robot(name))
    return replace(model, spec=replace(model.spec, limits=limits))


def scene(world, **params):
    return make_scene({record.name: record for record in world_types()}[world], params)


def setup(robot_name="free_tool", world="valley", point="tip", limits=UNLIMITED, params=None, **settings):
    """A set-up with silent sensors and the centre of compliance at a point of the tool."""
    task = scene(world, **(params or {}))
    coc = np.array(task.tool.frames[point] if isinstance(point, str) else point, dtype=float)
    return Setup(
        robot=robot(robot_name, limits), scene=task, center_of_compliance=coc, **{"sensors": SILENT, **settings}
    )


def generators(count, seed=0):
    return [np.random.default_rng([seed, i]) for i in range(count)]


def run(skill, setting, draws=None, count=1, seed=0, **options):
    """`simulate` with draws given as numbers or arrays."""
    draws = {key: np.broadcast_to(np.asarray(v, dtype=float), (count,)).copy() for key, v in (draws or {}).items()}
    return simulate(skill, setting, draws, generators(count, seed), **options)
