"""Short ways to the trials of `skillframe_search.trials`, shared by the tests. Robots and scenes are loaded once."""

from functools import cache

import numpy as np
from skillframe_search import trials
from skillframe_search.trials import FOUND_M, Task, starts

from skillframe.execution.prepare import load_robot_model

__all__ = ["FOUND_M", "PARAMS", "PEG", "demonstrations", "document", "goals", "robot", "scene", "search", "starts"]
FILLET_M = 0.0008  # of the peg; its size sets how hard the search is
PEG = {"fillet": FILLET_M, "done_depth": FOUND_M}
PARAMS = {"peg_in_hole": PEG, "socket": {"done_depth": FOUND_M}}
SPEED = 0.015
ZERO = (0.0, 0.0, 0.0)


def task(world, believed=ZERO, centre=ZERO):
    params = (("fillet", FILLET_M),) if world == "peg_in_hole" else ()
    return Task(world, params, believed, centre)


@cache
def scene(world):
    return task(world).scene


@cache
def robot(name="free_tool"):
    return load_robot_model(name)


def demonstrations(world, believed, centre=ZERO):
    """Five blind searches of a world by a person who believes in N(centre, believed^2)."""
    return trials.demonstrations(task(world, believed, centre))


def document(world, believed, centre=ZERO, **settings):
    """A search learned at the tip, at 15 mm/s like all its rivals."""
    given = demonstrations(world, believed, centre)
    return trials.document(task(world), given, **{"speed": SPEED, "push": 10.0, **settings})


def goals(count, believed, centre=ZERO, seed=100):
    """(count, 3) where the goal is against the start [m, m, rad]."""
    return trials.goals(count, task("peg_in_hole", believed, centre), seed)


def search(found, world, where, duration=22.0, seed=5, machine="free_tool", draws=None):
    """Result of one batch, and seconds to the find per trial (inf where it was not found)."""
    given = robot(machine)
    return trials.search(found, scene(world), where, duration_s=duration, seed=seed, robot=given, draws=draws)


def shares(times, budgets):
    """Share found within each budget of seconds."""
    return [float((times <= budget).mean()) for budget in budgets]


def wilson(hits, count):
    """Two-sided 95 % score interval of a proportion."""
    z, share = 1.96, hits / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(share * (1 - share) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return middle - half, middle + half
