"""The version of the plug-in contract, and the versions that this skillframe supports.

The contract covers hooks, records, observations and commands. Its version is that of the first skillframe that has it.
A plug-in states its contract by `skillframe_contract = "0.2"` in its entry module, or by `contract` of a record;
without a statement it is 0.1. A plug-in of an unsupported contract, or whose distribution requires another skillframe,
is not loaded, since a skill's observations and commands could differ from what its author meant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

GROUP = "skillframe"
"""Group of the entry points of plug-ins."""
CONTRACT = "0.2"
"""Contract of this skillframe."""
OLDEST = "0.1"
"""The oldest supported contract: the previous minor version."""
ATTRIBUTE = "skillframe_contract"


def contract_problem(what: str, stated: object) -> str:
    """A sentence if a stated contract is unsupported, otherwise "".

    Args:
        what: what states it, the beginning of the sentence: "the plug-in", "skill 'slide'".
        stated: the version, "0.2"; "" or None for none.
    """
    if stated in ("", None):
        return ""
    if not isinstance(stated, str) or not re.fullmatch(r"\d+\.\d+", stated):
        return f"{what} states the contract {stated!r}; write two numbers in quotes, {CONTRACT!r}"
    window = f"and this skillframe serves {OLDEST} to {CONTRACT}"
    if _numbers(stated) > _numbers(CONTRACT):
        return f"{what} was written for contract {stated}, {window}; update skillframe"
    if _numbers(stated) < _numbers(OLDEST):
        return f"{what} was written for contract {stated}, {window}; install a newer version of the plug-in"
    return ""


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def requirement_problem(requires: Iterable[str], version: str) -> str:
    """A sentence if a distribution requires another skillframe than the installed one, otherwise "".

    Args:
        requires: its requirements, as in its metadata.
        version: of skillframe; suffixes ("0.2.0.dev1") are ignored.
    """
    asked = [text for text in requires if re.match(r"skillframe(?![\w.-])", text.strip(), re.IGNORECASE)]
    if not asked:
        return ""
    from packaging.requirements import InvalidRequirement, Requirement
    from packaging.version import Version

    here = Version(version).base_version
    for text in asked:
        try:
            wanted = Requirement(text)
        except InvalidRequirement:
            return f"its metadata requires {text!r}, which is no requirement; install it again"
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        if here not in wanted.specifier:
            return f"it requires skillframe{wanted.specifier}, and {version} is installed; install versions that fit"
    return ""
