"""Lists docstrings whose first line has a semicolon: python -m tests.first_lines [FOLDER ...].

A first line is one plain sentence, or two. A semicolon in quotes, backticks or brackets belongs to a name or a formula.
"""

import ast
import re
import sys
from pathlib import Path

NOT_PROSE = re.compile(r"`[^`]*`|\"[^\"]*\"|\([^()]*\)|\[[^\]]*\]")


def below(node):
    """Statements that stand directly under one, in all of its blocks."""
    for block in ("body", "handlers", "cases", "orelse", "finalbody"):
        yield from getattr(node, block, ())


def statements(node):
    """A module or statement, and every statement under it. Expressions are not entered, which hold no statement."""
    yield node
    for child in below(node):
        yield from statements(child)


def semicolons(tree):
    """(line, text) of each in a syntax tree."""
    for node in statements(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = (ast.get_docstring(node) or "").split("\n")[0]
            if ";" in NOT_PROSE.sub("", text):
                yield node.body[0].lineno, text


def with_semicolon(folder):
    """(file, line, text) of each."""
    for path in sorted(Path(folder).rglob("*.py")):
        for line, text in semicolons(ast.parse(path.read_text(encoding="utf-8"))):
            yield path, line, text


if __name__ == "__main__":
    for folder in sys.argv[1:] or ("skillframe", "plugins", "tests"):
        for path, line, text in with_semicolon(folder):
            print(f"{path}:{line}: {text}")
