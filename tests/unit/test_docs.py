"""The reference is complete: every hook with its signature, every public module; and what it shows works."""

import ast
import importlib
import inspect
import re
import shutil
import sys
import types
from pathlib import Path

import click
import pytest

import skillframe
from skillframe.extend import hookspecs
from skillframe.extend.registry import KINDS, Plugin, load_registry

DOCS = Path(__file__).resolve().parents[2] / "docs"
HOOKS = (DOCS / "reference" / "hooks.md").read_text(encoding="utf-8")
API = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```", HOOKS, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("hook", KINDS.values())
def test_every_hook_is_in_the_reference_with_its_signature(hook):
    signature = inspect.signature(getattr(hookspecs, hook))
    assert f"## `{hook}{str(signature).replace(chr(39), '')}`" in HOOKS


def test_every_hook_of_the_specification_is_one_that_the_registry_calls():
    specified = {n for n in dir(hookspecs) if n.startswith("skillframe_") and callable(getattr(hookspecs, n))}
    assert specified == set(KINDS.values())


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda code: re.search(r"def (skillframe_\w+)", code).group(1))
def test_every_example_of_a_hook_loads_and_conforms(example, monkeypatch, tmp_path):
    from skillframe_testkit.checks import check_plugin

    from skillframe.robot import load_robot

    module = types.ModuleType("example_plugin")
    module.__file__ = str(tmp_path / "example_plugin.py")
    shutil.copytree(load_robot("free_tool").folder, tmp_path / "robots" / "my_arm")  # that the example ships
    monkeypatch.setitem(sys.modules, "example_plugin", module)
    exec(compile(example, "hooks.md", "exec"), module.__dict__)
    known = load_registry()
    plugin = known.add(Plugin(name="example", distribution="example", version="1"), lambda: module)
    problems = [p for finding in check_plugin(known, plugin) for p in finding.problems or []]
    assert len(plugin.provides) == 1
    assert not problems


def test_every_name_of_the_package_is_in_the_api_reference():
    names = {name for name in skillframe.__all__ if name != "__version__"}
    assert not {
        name for name in names if f"auto{kind_of(name)}:: skillframe.{name}\n" not in API and f"`{name}`" not in API
    }


def kind_of(name):
    return "class" if isinstance(getattr(skillframe, name), type) else "function"


def test_every_module_of_the_api_reference_exists():
    for name in re.findall(r"automodule:: ([\w.]+)", API):
        importlib.import_module(name)


def test_every_public_name_of_the_package_is_what_it_says():
    for name in skillframe.__all__:
        assert getattr(skillframe, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = skillframe.nothing


def test_every_python_block_in_the_docs_parses():
    for page in DOCS.rglob("*.md"):
        for block in re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
            ast.parse(block, filename=str(page))


def test_every_evidence_page_names_its_command_and_is_linked_both_ways_with_an_explanation_or_a_how_to():
    rooms = ("explanation", "how-to")
    explained = {
        f"{room}/{p.name}": p.read_text(encoding="utf-8") for room in rooms for p in (DOCS / room).glob("*.md")
    }
    pages = list((DOCS / "evidence").glob("*.md"))
    assert pages
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert re.search(r"make (figures|bench|mutants)|pytest|python -m tests\.figures", text), page.name
        sources = re.findall(r"\.\./((?:explanation|how-to)/[\w-]+\.md)", text)
        assert any(f"../evidence/{page.name}" in explained[source] for source in sources), page.name


def test_explanations_of_how_it_works_hold_no_seeds():
    assert not [p.name for p in (DOCS / "explanation").glob("*.md") if re.search(r"[Ss]eeds? \d", p.read_text("utf-8"))]


def test_maths_in_the_pages_is_marked_as_the_builder_reads_it():
    assert not [page.name for page in DOCS.rglob("*.md") if r"\(" in page.read_text(encoding="utf-8")]


def commands():
    """Every command by the words that call it; "" is the program itself."""
    from skillframe.cli.main import cli

    def below(words, command):
        yield " ".join(words), command
        if isinstance(command, click.Group):
            context = click.Context(command)
            for name in command.list_commands(context):
                yield from below([*words, name], command.get_command(context, name))

    return dict(below([], cli))


def parameters(command):
    """What a command takes, options of plug-ins included."""
    return command.get_params(click.Context(command))


def shown():
    """(place, line) of every command line that help texts, pages and the change log show, in blocks and sentences."""
    pages = [*DOCS.rglob("*.md"), DOCS.parent / "README.md", *DOCS.parent.glob("plugins/*/README.md")]
    texts = {f"help of skillframe {words}": command.help or "" for words, command in commands().items()}
    for page in pages:
        blocks = re.findall(r"^ *```\w*\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
        texts[page.relative_to(DOCS.parent).as_posix()] = "\n".join(blocks)
    for place, text in texts.items():
        for line in re.findall(r"^ *(?:\$ )?skillframe (.+)$", text.replace("\\\n", " "), re.MULTILINE):
            yield place, line
    for page in [*pages, DOCS.parent / "CHANGELOG.md"]:
        for line in re.findall(r"(?<!`)`skillframe ([a-z][^`]*)`", page.read_text(encoding="utf-8")):
            yield page.name, line


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_every_command_line_that_is_shown_names_a_command_and_options_that_exist():
    known = commands()
    assert not [f"{place}: {problem}" for place, line in shown() if (problem := problem_of(line.split(), known))]


def problem_of(parts, known):
    name = ""
    while parts and f"{name} {parts[0]}".strip() in known:
        name = f"{name} {parts.pop(0)}".strip()
    if not name:
        return f"there is no command in '{' '.join(parts)}'"
    options = {o for p in parameters(known[name]) for o in [*p.opts, *p.secondary_opts]} | {"--help"}
    unknown = [part for part in parts if part.startswith("--") and part.partition("=")[0] not in options]
    return f"'{name}' has no {', '.join(unknown)}" if unknown else ""


def test_every_link_of_a_readme_leads_to_a_file():
    """Sphinx checks those of the docs."""
    broken = [
        f"{page.relative_to(DOCS.parent)}: {link}"
        for page in [*DOCS.parent.glob("*.md"), *DOCS.parent.glob("plugins/*/README.md")]
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
        if not re.match(r"[a-z]+:", link) and not (page.parent / link).exists()
    ]
    assert not broken
