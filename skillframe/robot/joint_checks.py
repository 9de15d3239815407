"""What is worth knowing about a robot's joints and meshes. Nothing here makes it unusable."""

from __future__ import annotations

from collections.abc import Iterator

from skillframe.robot.bodies import missing_meshes
from skillframe.robot.model import RobotModel, mimic_joints
from skillframe.robot.numbers import numbers
from skillframe.robot.problems import Problem
from skillframe.robot.resistance import hurting
from skillframe.robot.urdf import Joint

_ACTUATED = ("revolute", "continuous", "prismatic")
_FREE = "it counts as free within +-2 pi rad or +-10 m"


def joint_warnings(robot: RobotModel) -> Iterator[Problem]:
    """Limits that are missing or make no sense, mimic and continuous joints, meshes that are not there."""
    passive = _passive(robot)
    for joint in robot.urdf.joints.values():
        yield from _effort(joint, passive)
        yield from _position(joint)
        if joint.type == "continuous":
            text = f"joint {joint.name!r} is continuous: it has two coordinates in q (cosine, sine) and one in v"
            yield _warning("continuous", joint.name, text, "nothing to do; give angles in [home] as usual")
    yield from _mimic(robot)
    yield from _resisting(robot)
    for uri, link in missing_meshes(robot.urdf).items():
        text = f"mesh {uri!r} is not found; the robot works without it, its drawing, size and collisions do not know it"
        yield _warning(
            "missing_mesh", link, text, "put its package's parent folder into SKILLFRAME_PATH or ROS_PACKAGE_PATH"
        )
    if robot.model.nv == 0:
        text = "nothing moves: there is no joint but fixed ones, and the base is fixed"
        yield _warning("no_moving_joints", robot.urdf.root, text, 'write base = "free" in robot.toml for a free body')
    if robot.spec.loop and not robot.spec.actuation:
        text = "it has [[loop]] and no [[actuation]]: nothing drives its loops, so it can be checked and shown, not run"
        yield _warning("not_driven", "robot.toml", text, "say in [[actuation]] which joints of the loops are driven")


def _passive(robot: RobotModel) -> tuple[str, ...]:
    """Joints without a motor: followers and, of a hydraulic machine, all that carry no cylinder."""
    driven = {actuation.joint for actuation in robot.spec.actuation if robot.spec.hydraulic}
    rest = [name for name in robot.urdf.joints if driven and name not in driven]
    return (*robot.followers, *rest)


def _effort(joint: Joint, passive: tuple[str, ...]) -> Iterator[Problem]:
    if joint.type not in _ACTUATED or joint.name in passive:
        return
    if not _limit(joint, "effort") > 0.0:
        text = f"joint {joint.name!r} has no effort limit; its motor counts as unlimited"
        yield _warning("no_effort_limits", joint.name, text, 'write effort="..." [N m or N] in its <limit>')


def _position(joint: Joint) -> Iterator[Problem]:
    if joint.type not in ("revolute", "prismatic"):
        return
    low, high = _limit(joint, "lower"), _limit(joint, "upper")
    fix = 'write lower="..." and upper="..." in its <limit>'
    if joint.element.find("limit") is None:
        text = f"joint {joint.name!r} has no limits; {_FREE}"
        yield _warning("no_position_limits", joint.name, text, fix)
    elif low == high:
        text = f"joint {joint.name!r} has equal limits ({low:g}); {_FREE}"
        yield _warning("no_position_limits", joint.name, text, fix)
    elif low > high:
        text = f"joint {joint.name!r} has its limits reversed ({low:g} > {high:g}); {_FREE}"
        yield _warning("reversed_limits", joint.name, text, "exchange lower and upper")


def _resisting(robot: RobotModel) -> Iterator[Problem]:
    """Joints whose friction and damping take a good part of what skills push with."""
    head = "put this into robot.toml, with what the maker says (0 where the arm compensates by itself):"
    for one in hurting(robot) if not robot.spec.hydraulic else ():
        text = f"joint {one.joint!r} has {one.figures}, which takes {one.push:.2g} N of the 20 N that skills push with"
        text += "; it is compensated while the joint moves, not at rest" if robot.spec.dynamics.compensate else ""
        fix = f"{head}\n[dynamics.joint]\n{one.joint} = {{ friction = 0.0, damping = 0.0 }}"
        yield _warning("joint_resists", one.joint, text, fix)


def _mimic(robot: RobotModel) -> Iterator[Problem]:
    for name in mimic_joints(robot.urdf):
        element = robot.urdf.joints[name].element.find("mimic")
        leader = element.get("joint") if element is not None else None
        if robot.mimic_fallback:
            text = f"joint {name!r} should follow {leader!r} and is independent instead ({robot.mimic_fallback})"
            fix = (
                "let every mimic joint follow a joint that moves, is no follower itself and comes before it "
                "(branches are taken in the alphabetical order of their joints)"
            )
            yield _warning("mimic_independent", name, text, fix)
        elif name in robot.followers:
            text = f"joint {name!r} follows {leader!r}: it has no coordinate of its own"
            yield _warning("mimic", name, text, "write mimic = false in robot.toml to make it independent")


def _limit(joint: Joint, name: str) -> float:
    return numbers(joint.element.find("limit"), name, 1, (0.0,))[0]


def _warning(code: str, where: str, message: str, fix: str) -> Problem:
    return Problem(code=code, severity="warning", where=where, message=message, fix=fix)
