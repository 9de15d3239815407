"""Collects problems, including errors raised by a check."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

from skillframe.extend import Document


def attempt(what: str, check: Callable[[], Iterable[str]]) -> list[str]:
    """Problems found or raised by a check."""
    try:
        return [f"{what}: {problem}" for problem in check()]
    except (Exception, SystemExit) as error:  # code of a plug-in
        return [f"{what}: raised {type(error).__name__}: {error}"]


def json_problems(document: Document) -> list[str]:
    """Problems of a document that is not plain JSON, or changes in a round trip."""
    back: Any = json.loads(json.dumps(document, allow_nan=False, sort_keys=True))
    if back != document:
        return ["changes when written as JSON and read back; use plain lists, numbers, strings, booleans and None only"]
    return []
