"""Statistics of trials: which policy is better, and in which box of parameters a skill reaches a success rate.

`compare` tests policies in a table of `trials`. A `question` about a skill leads by its exploratory trials, `surrogate`
and `box` to a `claim`, which `procedure` tests and `certificate` reports. Listing plug-ins imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import FolderType, Lazy, LazyCommand

skillframe_contract = "0.2"

PLACE = "skillframe_certify.commands"
certify_command = LazyCommand("Certify where a skill works, and find what breaks it.", f"{PLACE}.group:command")
compare_command = LazyCommand("Say which policy is better, from a table of trials.", f"{PLACE}.compare:command")
trials_command = LazyCommand("Enter trials of a real robot, and compute their success rate.", f"{PLACE}.enter:trials")


@hookimpl
def skillframe_folders() -> Iterable[FolderType]:
    """The folder of a claim, whose first report page is the certificate."""
    place = "skillframe_certify.report"
    yield FolderType(
        name="claim", summary="a question, its claim, and the trials that it rests on", title="Certificate",
        holds=Lazy(f"{place}.answers:is_asked"), live=Lazy(f"{place}.answers:look_of"),
        read=Lazy(f"{place}.answers:read_asked"), page=Lazy(f"{place}.first_page:certificate_page"),
    )  # fmt: skip
