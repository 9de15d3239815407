r"""Whether a closed chain can stand in a configuration: reach, stroke, dead centre, and holding pressure.

A cylinder pushes at most \(A_a p_S - A_b p_R\) and pulls at most \(A_b p_S - A_a p_R\); at rest it must hold
F = R^-T G^T g (`robot.chain`). Near a dead centre the moment arm dx/dz vanishes and no force helps. Friction is
neglected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.robot import MISFIT, Actuation, ClosedChain, OutOfReach
from skillframe_hydraulics.checks.figures import CYLINDER, is_motor, needed, relief, require_known
from skillframe_hydraulics.checks.figures import areas as chamber_areas
from skillframe_hydraulics.checks.load_holding import low_setting, opens_by_itself

LEAST_ARM = 0.1  # m, or a sixth of the stroke: a force error of 1 kN has less than a third of its effect at mid stroke
HELD = 0.75  # of an actuator's force; sound machines hold their load with 0.6, and one with 0.79 failed in the swing
COVERED = 0.5  # share of a joint's range below which its cylinder's lengths are doubted; drawn ranges are often wide
_NEEDED = ("bore", "rod", "stroke", "supply_pressure", "return_pressure")


class Capacity(NamedTuple):
    """Largest push and pull [N, Nm] and stroke [m, 0 of a motor]."""

    push: float
    pull: float
    stroke: float


def capacity(actuation: Actuation, where: object = "robot.toml") -> Capacity:
    """Largest push and pull of a hydraulic cylinder at rest, by its supply and its port relief.

    Raises:
        InputError: a required parameter is missing.
    """
    require_known(actuation, _NEEDED, where)
    p, (area_a, area_b) = actuation.known, chamber_areas(actuation)
    high, low = min(p["supply_pressure"], relief(actuation)), p["return_pressure"]
    return Capacity(area_a * high - area_b * low, area_b * high - area_a * low, p.get("stroke", 0.0))


def areas(actuation: Sequence[Actuation]) -> Float:
    """Piston areas (k,) [m^2], by which actuators of one joint share its load, or 1 for all if one is unknown."""
    sizes = [a.known.get("displacement" if is_motor(a) else "bore") for a in actuation]
    if not all(isinstance(size, (int, float)) and size > 0.0 for size in sizes):
        return np.ones(len(sizes))
    return np.array([_area(a) for a in actuation], dtype=np.float64)


def _area(actuation: Actuation) -> float:
    """Area of chamber a [m^2], or volume per radian of a motor [m^3]."""
    p = actuation.known
    return float(p["displacement"]) if is_motor(actuation) else math.pi / 4 * float(p["bore"]) ** 2


def problems(chain: ClosedChain, z: Float) -> list[str]:
    """Sentences on why the chain cannot stand at minimal coordinates (n,), empty if it can.

    Foreign actuators without areas or pressures are checked for stroke and moment arm only.

    Raises:
        InputError: a cylinder without pressures or areas.
    """
    try:
        state = chain.at(z, np.zeros(len(chain.independent)))
    except OutOfReach as error:
        return [f"{error.problem}; {error.fix}"]
    found = [
        f"the loop {name} is open by {1e3 * gap:.3g} mm, because its joints do not turn in one plane"
        for name, gap in zip((loop.name for loop in chain.loops), norm(chain.gaps(state.q)), strict=True)
        if gap > MISFIT
    ]
    turns = np.abs(state.embedding[chain.dependent]).max(axis=1, initial=0.0)
    for joint, turn in zip(chain.dependent, turns, strict=True):
        if turn > 20.0:  # an encoder's 0.1 mrad becomes 2 mrad, and bodies seem 400 times as heavy
            name = chain.model.names[int(joint) + 1]
            far = f"it moves {turn:.3g} times as far as what moves it"
            found.append(f"the linkage of {name} is near its dead centre: {far}")
    found += _outside(chain, state.q)
    strokes = {a.joint: float(a.known.get("stroke", math.inf)) for a in chain.robot.spec.actuation}
    own = np.take_along_axis(np.abs(state.arms), moved_by(state.arms[:, : chain.steered])[:, None], axis=1)[:, 0]
    for name, arm in zip(chain.actuated, own, strict=True):
        least = min(LEAST_ARM, strokes.get(name, math.inf) / 6.0)
        if name not in chain.independent and arm < least:
            found.append(f"{name} is near its dead centre: its moment arm is {arm:.3f} m, below {least:.3g} m")
    if not found:
        spec = chain.robot.spec
        for actuation, force in zip(spec.actuation, state.holding_force(areas(spec.actuation) ** 2), strict=False):
            if actuation.fmu == CYLINDER or all(name in actuation.known for name in needed(actuation, _NEEDED)):
                found += _overload(actuation, force, spec.folder / "robot.toml")
                found += opens_by_itself(actuation, float(force))
    return found


def moved_by(arms: Float) -> NDArray[np.int64]:
    """The coordinate (k,) that each actuator moves, of arms dx/dz (k, n) of the steered coordinates.

    A bucket's cylinder on the frame of a loader turns with the arm, too, which its own cylinder moves: of all pairings
    it is that with the largest product of arms. An actuator beside another one moves what that one moves.
    """
    size = np.maximum(np.abs(arms), 1e-12)
    rows, columns = linear_sum_assignment(-np.log(size))
    moved = np.empty(len(arms), dtype=np.int64)
    moved[rows] = columns
    direction = arms / norm(size)[:, None]
    for row in set(range(len(arms))) - set(rows.tolist()):
        moved[row] = columns[np.argmax(np.abs(direction[rows] @ direction[row]))]
    return moved


def strained_actuators(chain: ClosedChain, z: Float) -> Iterator[str]:
    """Sentences on actuators that use more than `HELD` of their force to hold their load at coordinates z (n,)."""
    spec, state = chain.robot.spec, chain.at(z, np.zeros(len(z)))
    for one, force in zip(spec.actuation, state.holding_force(areas(spec.actuation) ** 2), strict=True):
        if any(name not in one.known for name in needed(one, _NEEDED)):
            continue
        limit = capacity(one)
        most = limit.push if force > 0.0 else limit.pull
        if abs(force) > HELD * most:
            share = f"{100.0 * abs(force) / most:.0f} % of its force to hold its load"
            yield f"at home {one.joint} needs {share}: a run may end in the swing, for want of force to move it"


def low_settings(chain: ClosedChain, z: Float) -> Iterator[str]:
    """Sentences on counterbalance valves that are set low for the loads at coordinates z (n,)."""
    spec, state = chain.robot.spec, chain.at(z, np.zeros(len(z)))
    for one, force in zip(spec.actuation, state.holding_force(areas(spec.actuation) ** 2), strict=True):
        if (
            text := ""
            if any(name not in one.known for name in needed(one, _NEEDED))
            else low_setting(one, float(force))
        ):
            yield text


def require_feasible(chain: ClosedChain, z: Float) -> None:
    """Refuse a configuration that the machine cannot stand in.

    Raises:
        InputError: names every joint that prevents it.
    """
    found = problems(chain, z)
    if found:
        place = ", ".join(f"{name} {value:.4g}" for name, value in zip(chain.independent, z, strict=True))
        raise InputError(f"{chain.robot.spec.name} at {place}", "; ".join(found), "choose another configuration")


def _outside(chain: ClosedChain, q: Float) -> list[str]:
    model, found = chain.model, []
    struts = {f"{strut.name}_rod": strut for strut in chain.robot.spec.strut}
    for index in range(1, model.njoints):
        value = q[i := model.joints[index].idx_q]
        low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
        if low - 1e-9 <= value <= high + 1e-9:
            continue
        if strut := struts.get(model.names[index]):
            size = f"{strut.closed:.4g} to {strut.closed + strut.stroke:.4g} m long"
            found.append(f"the pins of {strut.name} would be {strut.closed + value:.4g} m apart, and it is {size}")
        else:
            found.append(f"{model.names[index]} would stand at {value:.4g}, outside {low:.4g} to {high:.4g}")
    positions = dict(
        zip(chain.actuated, q[[chain.model.joints[model.getJointId(n)].idx_q for n in chain.actuated]], strict=True)
    )
    for actuation in chain.robot.spec.actuation:
        if actuation.joint in struts:
            continue
        if actuation.fmu == CYLINDER and "stroke" in actuation.known and not is_motor(actuation):
            value, stroke = positions[actuation.joint], float(actuation.known["stroke"])
            slack = 0.02 + 0.02 * stroke  # tolerance of the FMU: fmus/hydraulic_cylinder/checks.h
            if not -slack <= value <= stroke + slack:
                found.append(f"{actuation.joint} would stand at {value:.4g} m, outside its stroke of {stroke:.4g} m")
    return found


def short_struts(chain: ClosedChain) -> Iterator[str]:
    """Sentences on cylinders that let the joint between their pins pass less than `COVERED` of its range."""
    model, data = chain.model, chain.model.createData()
    for strut in chain.robot.spec.strut:
        ends = [model.getFrameId(f"{strut.name}_{part}", pin.FrameType.BODY) for part in ("barrel", "eye")]
        base, eye = ({int(j) for j in model.supports[model.frames[end].parentJoint]} for end in ends)
        between = (base ^ eye) - {model.getJointId(f"{strut.name}_hinge")}
        if len(between) != 1:
            continue
        joint = between.pop()
        low, high = (float(limit[model.joints[joint].idx_q]) for limit in (
            model.lowerPositionLimit, model.upperPositionLimit))  # fmt: skip
        if high - low > 2.0 * math.pi - 0.01:  # drawn without limits: the cylinder limits it
            continue
        q, spread = chain.home.copy(), np.linspace(low, high, 201)
        apart = []
        for value in spread:
            q[model.joints[joint].idx_q] = value
            pin.framesForwardKinematics(model, data, q)
            apart.append(float(np.linalg.norm(data.oMf[ends[0]].translation - data.oMf[ends[1]].translation)))
        fits = (np.array(apart) >= strut.closed) & (np.array(apart) <= strut.closed + strut.stroke)
        if fits.mean() < COVERED:
            name, share = model.names[joint], f"{100.0 * fits.mean():.0f} %"
            apart_m = f"over it the pins are {min(apart):.4g} to {max(apart):.4g} m apart"
            size = f"it is {strut.closed:.4g} to {strut.closed + strut.stroke:.4g} m long"
            yield f"{strut.name} allows {share} of the range of {name}: {apart_m}, and {size}"


def require_held(actuation: Sequence[Actuation], hold: Float, supply: Float, where: object) -> None:
    """Refuse trials whose cylinders cannot hold their loads, without stiction.

    `hold` (N, k) are piston forces at rest [N], `supply` (N, k) supply pressures [Pa].

    Raises:
        InputError: names the first trial's overloaded cylinders.
    """
    for forces, pressures in zip(hold, supply, strict=True):
        found: list[str] = []
        for one, force, pressure in zip(actuation, forces, pressures, strict=True):
            found += _overload(replace(one, parameters={**one.parameters, "supply_pressure": float(pressure)}), force)
        if found:
            raise InputError(where, "; ".join(found), "raise the supply pressure, carry less, or start elsewhere")


def _overload(actuation: Actuation, force: float, where: object = "robot.toml") -> list[str]:
    """A sentence on a force that a cylinder cannot hold [N], or none."""
    limit, supply, opens = capacity(actuation, where), actuation.known["supply_pressure"], relief(actuation)
    given = f"{supply / 1e5:.4g} bar can give" if supply <= opens else f"port relief at {opens / 1e5:.4g} bar leaves"
    bound, way = (limit.push, "push") if force > 0.0 else (limit.pull, "pull")
    if abs(force) <= bound:
        return []
    if is_motor(actuation):
        way, unit = "turn with", "kNm"
    else:
        unit = "kN"
    asked = f"{actuation.joint} would have to {way} {abs(force) / 1e3:.1f} {unit}"
    return [f"{asked}, more than the {max(bound, 0.0) / 1e3:.1f} {unit} that {given}"]
