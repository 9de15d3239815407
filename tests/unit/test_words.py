"""What a user reads has the standard terms: pages, help, messages, and docstrings of public names.

Code in backticks, names of arguments and file names are not prose.
"""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TERMS = {
    r"attitudes?": "orientation",
    r"the law(?! of)": "controller",
    r"films?|filmed": "video",
    r"mouths?": "hole entrance",
    r"he|him|his|she|hers?": "teacher",
    r"persons?": "teacher",
    r"(?:gives?|gave|giving) way": "is compliant",
    r"(?:un)?told|tells?": "commanded, declared, known, shows",
    r"(?:un)?said": "stated",
    r"(?:the|same|other|independent|each|every|a|its) draws?": "sample",
    r"in the simulator(?!'s)": "in simulation",
    r"asked (?:for|of)": "commanded, required",
    r"looked at": "explored, checked",
    r"who (?:asks|writes|wants)": "name the role",
}
EXCEPTIONS = {
    ("docs/reference/words.md", "The person who demonstrates"): "the definition of a teacher",
    ("docs/explanation/search.md", "A person would then feel"): "a human operator, who teaches nothing",
    ("plugins/reports/src/skillframe_reports/scope.py", "no force was measured on a person"): "safety of people",
    ("plugins/papers/src/skillframe_papers/document.py", "before this figure was looked at"): "literally",
    ("docs/how-to/drive.md", 'witness = "person"'): "a value of cell.toml",
    ("plugins/drive/src/skillframe_drive/cell.py", '"person"'): "a value of cell.toml",
    ("plugins/drive/src/skillframe_drive/runs.py", "the person"): "the witness of cell.toml",
}
PAGES = (
    "README.md", "CONTRIBUTING.md", "docs/**/*.md", "plugins/*/README.md", "robots/*/README.md", "fmus/*/README.md",
)  # fmt: skip
CODE = re.compile(r"``?[^`]*``?|^\s*\w+(?:, \w+)*:(?= )|\{[^{}]*\}")
"""Literals, the names that begin an argument's description, and placeholders of messages."""


def pages():
    """(path, line) of each page."""
    for pattern in PAGES:
        for path in sorted(ROOT.glob(pattern)):
            if not {"_build", "gallery"} & set(path.parts):
                yield from ((path, line) for line in path.read_text(encoding="utf-8").splitlines())


def code():
    """(path, line) of each message, help text and docstring of a public name."""
    for path in sorted([*ROOT.glob("skillframe/**/*.py"), *ROOT.glob("plugins/*/src/**/*.py")]):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        docstrings = {
            id(line.value): getattr(node, "name", "")
            for node in ast.walk(tree)
            if isinstance(body := getattr(node, "body", None), list)
            for line in body
            if isinstance(line, ast.Expr)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                public = not docstrings.get(id(node), "").startswith("_")
                prose = id(node) in docstrings or " " in node.value.strip()
                yield from ((path, line) for line in node.value.splitlines() if public and prose)


@pytest.fixture(scope="module")
def prose():
    """(path, line, prose of it)."""
    return [(p.relative_to(ROOT).as_posix(), line, CODE.sub(" ", line)) for p, line in (*pages(), *code())]


@pytest.mark.parametrize("term", TERMS)
def test_a_standard_term_stands_where_an_old_one_stood(prose, term):
    old = re.compile(rf"(?<![\w.-])(?:{term})(?![\w-])", re.IGNORECASE)
    found = [
        f"{path}: {line.strip()}"
        for path, line, text in prose
        if old.search(text) and not any(path == where and part in line for where, part in EXCEPTIONS)
    ]
    assert not found, f"say {TERMS[term]}:\n" + "\n".join(found)


def test_every_exception_is_needed(prose):
    for where, part in EXCEPTIONS:
        assert any(path == where and part in line for path, line, _ in prose), (where, part)
