"""Skills on real robots.

A `link` is the interface of one maker's robot. `real` makes it a drive of skillframe's loop, so that the same skill
object runs in simulation and on the robot. `fake` is a simulated arm behind the maker's own protocol. Listing plug-ins
imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, LazyCommand, SectionType

skillframe_contract = "0.2"

drive_command = LazyCommand("Run a skill on a real robot, or on a fake one.", "skillframe_drive.commands:command")


@hookimpl
def skillframe_sections() -> Iterable[SectionType]:
    """What `drive hold` found, in the report of its folder."""
    yield SectionType(
        name="hold", title="Held against the simulation", order=5, make=Lazy("skillframe_drive.section:hold_section"),
        summary="a real run beside simulated ones of its certificate",
    )  # fmt: skip
