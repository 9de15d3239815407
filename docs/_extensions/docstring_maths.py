r"""Docstrings write maths as LaTeX does, \(x\), and sizes as |x|; Sphinx reads roles, and bars as substitutions."""

from __future__ import annotations

import re
from typing import Any

MATHS = re.compile(r"\\\((.+?)\\\)", re.DOTALL)


def mark(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Replace the maths of a docstring, and take its bars as they are, in place."""
    text = MATHS.sub(r":math:`\1`", "\n".join(lines))
    lines[:] = [line if "`" in line else line.replace("|", r"\|") for line in text.split("\n")]


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", mark)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
