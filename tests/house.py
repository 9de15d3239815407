"""Figures of the code base from its text: sizes, imports, names, words. `python -m tests.house` prints them.

`tests/house.toml` has a bound for each, which falls with its figure; `tests/unit/test_house.py` holds them.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
OIL = re.compile(r"hydraul|\boil\b|\bvalves?\b|\bcylinder_|\bpistons?\b|\bbore\b", re.IGNORECASE)
SETTINGS = re.compile(r"(Settings|Params|File|Keys|Options|Table|Config|Spec)$")


class File(NamedTuple):
    """A Python file: its path from the root, text, syntax tree, and how often each name stands in it."""

    path: str
    text: str
    tree: ast.Module
    names: Counter[str]
    words: int

    @property
    def lines(self) -> int:
        return self.text.count("\n")

    @property
    def module(self) -> str:
        name = re.sub(r"^plugins/[^/]+/src/", "", self.path).removesuffix("i").removesuffix(".py").replace("/", ".")
        return name.removesuffix(".__init__")

    @property
    def core(self) -> bool:
        return self.path.startswith("skillframe/")


@cache
def library() -> tuple[File, ...]:
    """The files of the core, with its lists of public names, and of the plug-ins, without the template of new ones."""
    found = [*ROOT.glob("skillframe/**/*.py"), *ROOT.glob("skillframe/**/*.pyi"), *ROOT.glob("plugins/*/src/**/*.py")]
    return tuple(_file(path) for path in sorted(found) if not {"plugin_template", "_data"} & set(path.parts))


def _file(path: Path) -> File:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    names = Counter(token.string for token in tokens if token.type == tokenize.NAME)
    comments = (token.string for token in tokens if token.type == tokenize.COMMENT)
    told = [*_docstrings(tree), *comments]
    return File(path.relative_to(ROOT).as_posix(), text, tree, names, sum(len(each.split()) for each in told))


def _docstrings(tree: ast.Module) -> list[str]:
    """Docstrings, and the texts that stand below attributes and constants."""
    bodies = (getattr(node, "body", None) for node in ast.walk(tree))
    lines = (line for body in bodies if isinstance(body, list) for line in body if isinstance(line, ast.Expr))
    values = (line.value.value for line in lines if isinstance(line.value, ast.Constant))
    return [value for value in values if isinstance(value, str)]


@cache
def imports() -> dict[str, set[str]]:
    """Modules of the library that each one imports, wherever the import stands, those of `Lazy` included."""
    modules = {file.module for file in library()}
    found: dict[str, set[str]] = {}
    for file in library():
        named: set[str] = set()
        for node in ast.walk(file.tree):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                home = ".".join([file.module] * node.level + [node.module] * bool(node.module))
                named |= {whole if (whole := f"{home}.{alias.name}") in modules else home for alias in node.names}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                named |= {node.value.partition(":")[0]} if re.fullmatch(r"[\w.]+:[\w.]+", node.value) else set()
        found[file.module] = found.get(file.module, set()) | (named & modules) - {file.module}
    found["skillframe"] = set()  # its public names are imported on use
    return found


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected components of more than one module (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    result: list[list[str]] = []
    sys.setrecursionlimit(10_000)

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph.get(node, ()):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            found = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(found) > 1:
                result.append(found)

    for node in graph:
        if node not in index:
            visit(node)
    return result


def private_functions(file: File) -> dict[str, int]:
    """How often each private function of a file is named in it besides where it is defined."""
    functions = [n.name for n in ast.walk(file.tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    defined = Counter(name for name in functions if name.startswith("_") and not name.startswith("__"))
    return {name: file.names[name] - count for name, count in defined.items()}


def numeric_constants(file: File) -> list[str]:
    """Names of the module's constants that hold a number."""
    found = []
    for node in file.tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
            values = (each.value for each in ast.walk(node.value) if isinstance(each, ast.Constant))
            if any(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
                found += [name for name in names if name.isupper()]
    return found


def setting_keys(file: File) -> int:
    """How many fields the dataclasses of settings in a file have."""
    classes = [node for node in ast.walk(file.tree) if isinstance(node, ast.ClassDef) and SETTINGS.search(node.name)]
    data = [node for node in classes if any("dataclass" in ast.unparse(each) for each in node.decorator_list)]
    return sum(isinstance(line, ast.AnnAssign) and "ClassVar" not in ast.unparse(line) for c in data for line in c.body)


def used_by_plugins() -> dict[str, set[str]]:
    """Plug-ins by the module of the core that they import."""
    found: dict[str, set[str]] = defaultdict(set)
    for file in library():
        if not file.core:
            for module in imports()[file.module]:
                if module.partition(".")[0] == "skillframe":
                    found[module].add(file.path.split("/")[1])
    return found


def words(pattern: str) -> int:
    """Words in the files of a pattern, but for what `make docs` writes."""
    files = [path for path in ROOT.glob(pattern) if not {"_build", "gallery"} & set(path.parts)]
    return sum(len(path.read_text(encoding="utf-8").split()) for path in files)


def figures() -> dict[str, int]:
    """Every figure by its name in `tests/house.toml`."""
    files, core = library(), [file for file in library() if file.core]
    once = [name for file in files for name, count in private_functions(file).items() if count == 1]
    tests = [*ROOT.glob("tests/**/*.py"), *ROOT.glob("plugins/*/tests/**/*.py"), ROOT / "conftest.py"]
    file_names = Counter(Path(file.path).name for file in files if "__init__" not in file.path)
    return {
        "core_lines": sum(file.lines for file in core),
        "core_files": len(core),
        "core_rooms": len({file.path.split("/")[1].removesuffix(".py") for file in core} - {"__init__"}),
        "library_lines": sum(file.lines for file in files),
        "core_files_that_name_oil": sum(bool(OIL.search(file.text)) for file in core),
        "file_circles": len(circles(imports())),
        "private_functions_called_once": len(once),
        "numeric_constants": sum(len(numeric_constants(file)) for file in files),
        "core_modules_that_plugins_import": len(used_by_plugins()),
        "setting_keys": sum(setting_keys(file) for file in files),
        "most_files_of_one_name": max(file_names.values()),
        "docs_words": words("docs/**/*.md"),
        "change_log_words": words("CHANGELOG.md"),
        "docstring_and_comment_words": sum(file.words for file in files),
        "test_lines": sum(path.read_text(encoding="utf-8").count("\n") for path in tests),
    }


def bounds() -> dict[str, int]:
    """The most that each figure may be."""
    return tomllib.loads((ROOT / "tests" / "house.toml").read_text(encoding="utf-8"))


if __name__ == "__main__":
    if len(sys.argv) > 1:  # the list behind a figure
        lists = {
            "circles": lambda: [" ".join(each) for each in circles(imports())],
            "oil": lambda: [file.path for file in library() if file.core and OIL.search(file.text)],
            "once": lambda: [f"{f.path} {n}" for f in library() for n, c in private_functions(f).items() if c == 1],
            "used": lambda: [f"{len(by)} {module}" for module, by in sorted(used_by_plugins().items())],
        }
        print("\n".join(lists[sys.argv[1]]()))
    else:
        for name, value in figures().items():
            print(f"{name:36}{value:10,}   at most {bounds().get(name, 0):,}")
