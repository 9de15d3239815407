"""The version of the plug-in contract, and the window of versions that this skillframe serves.

The contract is what a plug-in and the core rely on: hooks, records, observations and commands. Its version is that of
the first skillframe that has it. A plug-in says which one it was written for, by `skillframe_contract = "0.2"` in its
entry module, or by `contract` of a record. One that says nothing was written before it could: 0.1.

A plug-in out of the window is not loaded, and neither is one whose distribution asks for another skillframe: what a
skill is told and what is done with its commands could differ from what its author meant (our choice).
"""

from __future__ import annotations

import re
from collections.abc import Iterable

GROUP = "skillframe"
"""Entry points of plug-ins."""
CONTRACT = "0.2"
"""Of this skillframe."""
OLDEST = "0.1"
"""The oldest one that is still served: the minor version before."""
ATTRIBUTE = "skillframe_contract"


def contract_problem(what: str, stated: object) -> str:
    """A sentence if something was written for a contract that this skillframe does not serve, else "".

    Args:
        what: what states it, as the sentence begins: "the plug-in", "skill 'slide'".
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
    """A sentence if a distribution asks for another skillframe than there is, else "".

    Args:
        requires: its requirements, as in its metadata.
        version: of skillframe; what follows its numbers ("0.2.0.dev1") is left out of account.
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
            return f"its metadata asks for {text!r}, which is no requirement; install it again"
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        if here not in wanted.specifier:
            return f"it asks for skillframe{wanted.specifier}, and {version} is installed; install versions that fit"
    return ""
