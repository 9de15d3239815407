"""What is public is said on one page, and documented; how-tos, examples and first-party plug-ins use nothing else."""

import ast
import importlib
import inspect
import re
from functools import cache
from itertools import zip_longest
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
API = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
MODULES = re.findall(r"^\.\. automodule:: (\S+)\n((?:   :.*\n)*)", API, re.MULTILINE)
PAGES = [*ROOT.glob("docs/how-to/*.md"), *ROOT.glob("docs/tutorial/*.md"), *ROOT.glob("docs/reference/*.md")]
PAGES += [ROOT / "README.md", *ROOT.glob("plugins/*/README.md")]
SOURCES = [
    *ROOT.glob("plugins/*/src/**/*.py"),
    *ROOT.glob("examples/*.py"),
    *ROOT.glob("plugins/testkit/src/skillframe_testkit/plugin_template/**/*.py"),
]


def option(text, name):
    """The names that an option of a directive lists."""
    found = re.search(rf":{name}: (.*)", text)
    return {part.strip() for part in found[1].split(",")} if found else set()


@cache
def public():
    """Names by module that the page documents."""
    found = {"skillframe": set(importlib.import_module("skillframe").__all__)}
    for module, options in MODULES:
        listed = option(options, "members")
        found.setdefault(module, set()).update(listed or all_of(importlib.import_module(module)))
    return found


def all_of(module):
    """What the page shows of a module: its `__all__`, else what it defines and documents without an underscore."""
    if hasattr(module, "__all__"):
        return set(module.__all__)
    own = {n for n, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__}
    documented = {n for n in own if inspect.getdoc(getattr(module, n))} | constants(module)
    return {n for n in documented if not n.startswith("_")}


@cache
def constants(module):
    """Names that a module assigns at its top with a docstring below, or with a comment `#:`."""
    source = inspect.getsource(module)
    lines, body = source.splitlines(), ast.parse(source).body
    found = set()
    for node, following in zip_longest(body, body[1:]):
        below = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
        if below or "#:" in lines[node.lineno - 1] or lines[node.lineno - 2].startswith("#:"):
            targets = getattr(node, "targets", [getattr(node, "target", None)])
            found |= {n.id for target in targets if target for n in ast.walk(target) if isinstance(n, ast.Name)}
    return found


def homes(module, name):
    """The module, and where it has a name from."""
    stub = Path(module.__file__).with_suffix(".pyi")
    body = ast.parse(stub.read_text(encoding="utf-8") if stub.exists() else inspect.getsource(module)).body
    froms = [n for n in body if isinstance(n, ast.ImportFrom) and name in {alias.name for alias in n.names}]
    listed = getattr(module, "_PUBLIC", {}).get(name)
    places = [f"{module.__name__}." * n.level + (n.module or "") for n in froms] + [listed] * bool(listed)
    return [module, *map(importlib.import_module, [place.rstrip(".") for place in places])]


def imports(text):
    """(module, name) of everything of skillframe that a text imports, and a name for whole modules."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "skillframe":
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (("", alias.name) for alias in node.names if alias.name.split(".")[0] == "skillframe")


def is_public(module, name):
    """Is it on the page: a name of a module, or a module itself?"""
    whole = f"{module}.{name}".lstrip(".")
    if name in public().get(module, ()) or whole in public():
        return True
    handed_on = module in public() and hasattr(importlib.import_module(module), name)
    own = getattr(getattr(importlib.import_module(module), name), "__module__", module) if handed_on else module
    return own != module and name in public().get(own, ())


def wrong_in(text):
    return [f"{module}.{name}" for module, name in imports(text) if not is_public(module, name)]


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_a_page_imports_what_the_api_page_lists(path):
    blocks = re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert not [wrong for block in blocks for wrong in wrong_in(block)]


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_examples_and_first_party_plugins_import_what_the_api_page_lists(path):
    assert not wrong_in(path.read_text(encoding="utf-8"))


def test_every_name_that_the_page_lists_exists_and_is_documented():
    lacking = []
    for module, names in public().items():
        home = importlib.import_module(module)
        for name in names - {"__version__"}:
            value = getattr(home, name)
            routine = inspect.isroutine(value) or inspect.isclass(value) or inspect.ismodule(value)
            if not (inspect.getdoc(value) if routine else any(name in constants(m) for m in homes(home, name))):
                lacking.append(f"{module}.{name}")
    assert not lacking


def test_the_page_s_table_has_every_constant_and_type_that_a_package_exports_and_says_what_it_is(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_extensions"))
    from generated import constants as table

    cells = [line.strip("|").split(" | ") for line in table().splitlines()[2:]]
    listed = {(cell[0].strip(" `"), cell[1].strip("`")) for cell in cells}
    assert all(cell[2].strip() for cell in cells)
    packages = {stub.parent.name for stub in ROOT.glob("skillframe/*/__init__.pyi")}
    for package in sorted(packages):
        module = importlib.import_module(f"skillframe.{package}")
        values = {name: getattr(module, name) for name in module.__all__}
        plain = {
            n for n, v in values.items() if not (inspect.isroutine(v) or inspect.isclass(v) or inspect.ismodule(v))
        }
        assert {name for where, name in listed if where == f"skillframe.{package}"} >= plain


def test_no_module_stands_on_the_page_twice():
    names = [module for module, _ in MODULES]
    assert len(names) == len(set(names))


def test_an_import_that_the_page_does_not_list_is_noticed():
    assert wrong_in("from skillframe.execution.recorder import Recorder") == ["skillframe.execution.recorder.Recorder"]
    assert wrong_in("import skillframe.execution.recorder") == [".skillframe.execution.recorder"]
    assert wrong_in("from skillframe.execution.executor import Loop") == ["skillframe.execution.executor.Loop"]
    assert wrong_in("from skillframe import run\nfrom skillframe.skill import Skill\nimport skillframe.frames") == []
