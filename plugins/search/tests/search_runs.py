"""Blind demonstrations, goals and runs of searches in the simulated world, shared by the tests.

Everything is MuJoCo: demonstrations come from the blind teacher, a goal is found when the true tip is 2.5 mm below the
true surface, whatever the skill believes.
"""

from functools import cache

import numpy as np

from skillframe.blind_teacher import CUT, BlindSettings
from skillframe.demonstrate_blind import record_blind
from skillframe.executor import Setup, simulate
from skillframe.prepare import load_robot_model, load_world, prepare
from skillframe.records import LearnOptions
from skillframe.registry import registry
from skillframe.skillsource import learned

FOUND_M = 0.0025
PEG = {"fillet": 0.0008, "done_depth": FOUND_M}
SOCKET = {"done_depth": FOUND_M}
PARAMS = {"peg_in_hole": PEG, "socket": SOCKET}
SPEED = 0.015
NEAR_M, NEAR_RAD = 0.0015, 0.06  # a part set down this near falls in by itself


@cache
def scene(world):
    return load_world(world, PARAMS[world])


@cache
def robot(name="free_tool"):
    return load_robot_model(name)


@cache
def demonstrations(world, believed, centre):
    """Five blind searches of a world by a person who believes in N(centre, believed^2)."""
    settings = BlindSettings(believed=believed, centre=centre)
    return tuple(record_blind(robot(), scene(world), settings, count=5, seed=1).demonstrations)


def document(kind, world, believed, centre=(0.0, 0.0, 0.0), **settings):
    """A search learned at the tip, at 15 mm/s like all its rivals."""
    given = demonstrations(world, believed, centre)
    options = LearnOptions(at="tip", settings={"speed": SPEED, "push": 10.0, **settings})
    return learned(registry().skill(kind), given, options)


def goals(count, believed, centre=(0.0, 0.0, 0.0), seed=100):
    """(count, 3) where the goal is against the start [m, m, rad].

    Draws of the belief, cut at 2.5 deviations each, without those so near that there is nothing to search for.
    """
    rng = np.random.default_rng(seed)
    normal = rng.standard_normal((20 * count, 3))
    where = np.array(centre) + normal[np.abs(normal).max(axis=1) < CUT] * np.array(believed)
    trivial = (np.hypot(where[:, 0], where[:, 1]) < NEAR_M) & (np.abs(where[:, 2]) < NEAR_RAD)
    return where[~trivial][:count]


def starts(where):
    """Quantities of the executor that put the start at minus the goal."""
    return {"start.offset_x": -where[:, 0], "start.offset_y": -where[:, 1], "start.tilt_z": -where[:, 2]}


def search(found, world, where, duration=22.0, seed=5, machine="free_tool", draws=None):
    """Result of one batch, and seconds to the find per trial (inf where it was not found)."""
    skill, setup = prepare(robot(machine), scene(world), found)
    assert isinstance(setup, Setup)
    rngs = [np.random.default_rng([seed, i]) for i in range(len(where))]
    result = simulate(skill, setup, {**starts(where), **(draws or {})}, rngs, duration_s=duration)
    return result, np.where(result.success, result.duration_s, np.inf)


def shares(times, budgets):
    """Share found within each budget of seconds."""
    return [float((times <= budget).mean()) for budget in budgets]


def wilson(hits, count):
    """Two-sided 95 % score interval of a proportion."""
    z, share = 1.96, hits / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(share * (1 - share) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return middle - half, middle + half
