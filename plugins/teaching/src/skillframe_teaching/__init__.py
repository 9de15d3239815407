"""skillframe plug-in: simulated teachers, who demonstrate the task of a world."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, TeacherType

skillframe_contract = "0.2"


@hookimpl
def skillframe_teachers() -> Iterable[TeacherType]:
    """Teachers with a hand on the robot, at a teleoperation station, blindfolded, and one who takes the part out."""
    seeing, blind = "skillframe_teaching.sessions", "skillframe_teaching.blind"
    yield TeacherType(
        name="kinesthetic", summary="a hand on the robot",
        usual=Lazy(f"{seeing}:by_hand"), record=Lazy(f"{seeing}:record"),
    )  # fmt: skip
    yield TeacherType(
        name="teleoperation", summary="a hand on a master, with delay and scale",
        usual=Lazy(f"{seeing}:at_a_distance"), record=Lazy(f"{seeing}:record"),
    )  # fmt: skip
    yield TeacherType(
        name="blind", summary="searches blindfolded, guided by contact",
        usual=Lazy(f"{blind}:blindfolded"), record=Lazy(f"{blind}:record_blind"),
    )  # fmt: skip
    yield TeacherType(
        name="disassembly", summary="takes the part out, from its assembled pose",
        usual=Lazy("skillframe_teaching.disassembly:taking_out"),
        record=Lazy("skillframe_teaching.disassembly:record_removal"),
    )  # fmt: skip
