r"""The push to be expected: the mean of all pushes, each weighed by how well it explains every group of intervals.

A push passes iff it lies in the sector of every contact that has to be passed. The deepest such push (`directions`)
hangs on the two sectors that overlap least, so on their noise, and one group that is no face has a veto. Bayes' rule
with an even prior asks every group and believes none entirely. Group i of K_i intervals (`modes.groups`) has the mean
motion v_i and push edge m_i, and a push D lies out of their plane by out_i, at the angle a_i from v_i in a sector of
width w_i. It explains the group with

    S_i(D) = Phi(a_i / s) Phi((w_i - a_i) / s) exp(-out_i^2 / 2 sigma^2),     s = 5 degrees, sigma = 15 degrees

where Phi is the normal distribution function, and the group is no face with e_i = max(1/20, exp((1 - K_i) / 3)). So

    P(D) = product over i of (e_i + (1 - e_i) S_i(D)),     desired direction = unit of the mean of D weighed by P

over the directions whose P is at least a tenth of the largest, because the doubts leave a little everywhere.

A hand in the air moves the tool where it pushes, so the largest group of free intervals, alike within 35 degrees, is
one more factor, exp(-angle(D, v)^2 / 2 sigma^2) with e = 1/10, from three intervals on. One interval in contact, a
spike, says nothing (e = 1), and from ten on P does not count how long a face was slid on. Each S_i is nearly even
inside its sector, so that P is even inside the intersection and its mean is the intersection's middle.

Form and constants are our choice, because averages of motion and force passed steps, slides and skew ramps that the
deepest push missed. It is asked where modes decide (`votes`): faces of one side, of a tool that did not turn. After a
wrong first try the deepest push did better. docs/evidence/worth.md says what it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, radians

import numpy as np
from scipy.special import ndtr

from skillframe.frames import Float, cross, unit
from skillframe_lmc import sphere
from skillframe_lmc.intervals import Motion
from skillframe_lmc.modes import groups, without_wrong_try
from skillframe_lmc.sectors import Sectors, sectors

EDGE, OUT = radians(5.0), radians(15.0)  # s and sigma
DOUBT, FORGOTTEN = 0.05, 3.0  # least e, and the intervals over which the doubt of a group falls
DOUBT_IN_AIR = 0.1
ALIKE_IN_AIR, FEWEST_IN_AIR = radians(35.0), 3
COARSE, FINE = 32, 128  # cells of 6.3 and 1.6 degrees
BELIEVED, LEAST = 0.1, 0.01  # of the largest P: what counts in the mean, and what coarse cells are looked at again


def expected_push(motions: Sequence[Motion]) -> Float:
    """The expected push (3,) of demonstrations of which some touched something, of a tool that did not turn."""
    seen = groups(motions)
    air = _in_air(motions)
    cells, directions = sphere.whole(COARSE)
    resolution = COARSE
    while resolution < FINE:
        weight = _weight(directions, seen, air)
        cells, resolution = sphere.children(cells[weight > LEAST]), 2 * resolution
        directions = sphere.centres(cells, resolution)
    weight = _weight(directions, seen, air)
    mean: Float = unit(np.where(weight >= BELIEVED, weight, 0.0) @ directions)
    return mean


def explained(directions: Float, group: Sectors) -> Float:
    """S (C,) of directions (C, 3) by one group."""
    v, m = unit(group.motion.mean(axis=0)), unit(group.push.mean(axis=0))
    normal = unit(cross(v, m))
    across = cross(normal, v)
    width = np.arctan2(m @ across, m @ v)
    out = np.arcsin(np.clip(directions @ normal, -1.0, 1.0))
    angle = np.arctan2(directions @ across, directions @ v)
    inside: Float = ndtr(angle / EDGE) * ndtr((width - angle) / EDGE) * np.exp(-0.5 * (out / OUT) ** 2)
    return inside


def doubt(count: int) -> float:
    """How likely a group of so many intervals is no face. One interval alone, a spike, says nothing."""
    return max(DOUBT, exp((1.0 - count) / FORGOTTEN))


def _weight(directions: Float, seen: Sequence[Sectors], air: Float | None) -> Float:
    """P (C,) of directions (C, 3), 1 at its largest."""
    logs = np.zeros(len(directions))
    for group in seen:
        e = doubt(len(group.contact))
        logs += np.log(e + (1.0 - e) * explained(directions, group))
    if air is not None:
        off = np.arccos(np.clip(directions @ air, -1.0, 1.0))
        logs += np.log(DOUBT_IN_AIR + (1.0 - DOUBT_IN_AIR) * np.exp(-0.5 * (off / OUT) ** 2))
    weight: Float = np.exp(logs - logs.max())
    return weight


def _in_air(motions: Sequence[Motion]) -> Float | None:
    """Mean way (3,) of the largest group of free intervals, or None where there are few."""
    given = [sectors(without_wrong_try(motion)) for motion in motions]
    ways = np.concatenate([each.motion[~each.contact] for each in given])
    if not len(ways):
        return None
    alike = ways @ ways.T >= np.cos(ALIKE_IN_AIR)
    most = alike[np.argmax(alike.sum(axis=1))]
    mean: Float = unit(ways[most].mean(axis=0))
    return mean if most.sum() >= FEWEST_IN_AIR else None
