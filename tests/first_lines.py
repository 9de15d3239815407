"""Lists docstrings whose first line has a semicolon: python -m tests.first_lines [FOLDER ...].

A first line is one plain sentence, or two. A semicolon in quotes, backticks or brackets belongs to a name or a formula.
"""

import ast
import re
import sys
from pathlib import Path

NOT_PROSE = re.compile(r"`[^`]*`|\"[^\"]*\"|\([^()]*\)|\[[^\]]*\]")


def with_semicolon(folder):
    """(file, line, text) of each."""
    for path in sorted(Path(folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = (ast.get_docstring(node) or "").split("\n")[0]
                if ";" in NOT_PROSE.sub("", text):
                    yield path, node.body[0].lineno, text


if __name__ == "__main__":
    for folder in sys.argv[1:] or ("skillframe", "plugins", "tests"):
        for path, line, text in with_semicolon(folder):
            print(f"{path}:{line}: {text}")
