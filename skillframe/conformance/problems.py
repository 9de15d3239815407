"""Collecting problems: a check that raises is itself a problem, named with what was being tried."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

from skillframe.extend.records import Document


def attempt(what: str, check: Callable[[], Iterable[str]]) -> list[str]:
    """The problems that a check finds. Whatever it raises is one."""
    try:
        return [f"{what}: {problem}" for problem in check()]
    except (Exception, SystemExit) as error:  # foreign code: any failure is a finding
        return [f"{what}: raised {type(error).__name__}: {error}"]


def json_problems(document: Document) -> list[str]:
    """Whether a document is plain JSON that comes back equal, without NaN."""
    back: Any = json.loads(json.dumps(document, allow_nan=False, sort_keys=True))
    if back != document:
        return ["changes when written as JSON and read back; use plain lists, numbers, strings, booleans and None only"]
    return []
