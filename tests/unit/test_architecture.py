"""The import rules of the architecture, read from syntax trees; modules that do not exist yet are not visited."""

import ast
import re
import subprocess
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

import click
import pytest

from tests.first_lines import below, semicolons

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "skillframe"
PLUGINS = sorted(p for p in (ROOT / "plugins").iterdir() if (p / "src").is_dir())

FLOORS = [
    {"errors", "frames"},
    {"files", "signals", "skill"},
    {"config", "handover"},
    {"demonstration", "sequence", "robot", "fmu"},
    {"control", "cosim", "world"},
    {"extend"},
    {"document"},
    {"execution"},
    {"campaign"},
    {"api"},
    {"cli"},
]
FLOOR = {name: i for i, names in enumerate(FLOORS) for name in names}
FREE = {"__init__"}  # names what is public, for type checkers
MOST_ROOMS = 26
LOOP = {
    "skill",
    "handover",
    "sequence",
    "control",
    "world",
    "fmu",
    "signals",
    "cosim",
    "execution",
}
SET_UP = {  # finds, builds and unpacks FMUs before a run, simulates or exports them, holds a foreign one in its process
    f"skillframe/fmu/{name}.py"
    for name in (
        "build",
        "check",
        "child",
        "confine",
        "extract",
        "keeper",
        "library",
        "simulate",
        "ssp",
        "worker",
    )
} | {f"skillframe/execution/{name}.py" for name in ("prepare", "scores", "trace")}  # before a run, and after it
SET_UP |= {"skillframe/execution/drives/choose.py"}  # finds the drive, before a run
SET_UP |= {"skillframe/world/surfaces.py"}  # builds the contact generator, before a run


def top(path):
    """Name of the module or package directly under skillframe/."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def core_files():
    return sorted(p for p in PACKAGE.rglob("*.py") if "_data" not in p.parts and "template" not in p.parts)


@cache
def loop_files():
    return [p for p in core_files() if top(p) in LOOP and relative(p) not in SET_UP]


class Facts(NamedTuple):
    """What the rules ask of a file. Its syntax tree is let go: all of them slow whatever runs after them."""

    imports: list  # (line, module, only for types) of every import, wherever it stands; `from a import b` gives a.b
    calls: list  # (line, dotted name) of every call whose target is a plain dotted name
    classes: list  # names of public classes at top level
    semicolons: list  # first lines of docstrings that have one


@cache
def facts(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    called = (n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name | ast.Attribute))
    return Facts(
        imports=list(imports_below(tree, relative(path))),
        calls=[(node.lineno, ast.unparse(node.func)) for node in called] if path in loop_files() else [],
        classes=[n.name for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")],
        semicolons=[f"{relative(path)}:{line}: {text}" for line, text in semicolons(tree)],
    )


@cache
def relative(path):
    return path.relative_to(ROOT).as_posix()


def only_for_types(node):
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def imports_below(node, place, typed=False):
    for child in below(node):
        if isinstance(child, ast.Import):
            yield from ((child.lineno, alias.name, typed) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            assert child.level == 0, f"{place}:{child.lineno}: relative import; write the whole name"
            yield from ((child.lineno, f"{child.module}.{alias.name}", typed) for alias in child.names)
        else:
            yield from imports_below(child, place, typed or only_for_types(child))


def imports(path, at_run_time=True):
    """(line, module) of every import, of those for types only where it need not be at run time."""
    found = [(line, module) for line, module, typed in facts(path).imports if not (typed and at_run_time)]
    return [(line, exported().get(module, module)) for line, module in found]


@cache
def exported():
    """Where each name that a package of the core exports is defined, by its dotted names."""
    found = {}
    for path in PACKAGE.glob("*/__init__.pyi"):
        package = f"skillframe.{path.parent.name}"
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            home = ".".join([package, *([node.module] if node.module else [])])
            found |= {f"{package}.{alias.name}": f"{home}.{alias.name}" for alias in node.names}
    return found


def own(module):
    """The part of a dotted name directly under skillframe, or None."""
    parts = module.split(".")
    return parts[1] if parts[0] == "skillframe" and len(parts) > 1 else None


def test_every_module_of_the_core_has_a_floor():
    unknown = {top(p) for p in core_files()} - set(FLOOR) - FREE
    assert not unknown, f"say in FLOORS who may import {sorted(unknown)}"


def test_the_core_never_imports_a_plugin():
    found = [
        f"{relative(p)}:{line} {m}"
        for p in core_files()
        for line, m in imports(p, False)
        if m.startswith("skillframe_")
    ]
    assert not found


def arrows():
    """(room, room) to the lines that make it, for all imports, also those for types only."""
    found = {}
    for path in core_files():
        here = top(path)
        for line, module in imports(path, at_run_time=False):
            there = own(module)
            if here not in FREE and there in FLOOR and there != here:
                found.setdefault((here, there), []).append(f"{relative(path)}:{line} {module}")
    return found


def test_imports_go_downhill_only():
    uphill = {a: lines for a, lines in arrows().items() if FLOOR[a[1]] >= FLOOR[a[0]]}
    assert not uphill, "a room may import rooms on lower floors only"


def test_contributing_says_what_every_room_is_for():
    rows = [
        line for line in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines() if line.startswith("| `")
    ]
    said = [set(re.findall(r"`(\w+)`", line.split("|")[1])) for line in rows]
    assert said == FLOORS


def test_seven_files_explain_the_method():
    """Those that CONTRIBUTING names hold under 1,300 lines together, and each of the equations (1) to (5)."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    story = text[text.index("Read seven files") : text.index("What the loop steps")]
    names = re.findall(r"`([\w/]+\.py)`", story)
    texts = [(ROOT / name).read_text() for name in names]
    assert len(names) == 7
    assert sum(text.count("\n") for text in texts) < 1300
    equation = r"^ .*[=~].*\({}\)"  # indented, with its number behind it
    assert all(any(re.search(equation.format(n), text, re.M) for text in texts) for n in range(1, 6))


def test_the_first_line_of_a_docstring_has_no_semicolon():
    found = [said for p in [*core_files(), *ROOT.glob("plugins/*/src/**/*.py")] for said in facts(p).semicolons]
    assert not found


def test_there_are_few_rooms():
    rooms = {top(p) for p in core_files()} - FREE
    assert len(rooms) <= MOST_ROOMS, f"{len(rooms)} rooms"


def test_every_class_name_stands_once():
    found = {}
    for path in core_files():
        for name in facts(path).classes:
            found.setdefault(name, []).append(relative(path))
    twice = {name: places for name, places in found.items() if len(places) > 1 and name not in TWICE}
    assert not twice


TWICE = {}


def test_only_the_registry_names_the_core_s_own_plugin():
    found = [relative(p) for p in core_files() for _, m in imports(p) if m.startswith("skillframe.extend.builtin")]
    assert set(found) <= {"skillframe/extend/registry.py"}


FILES_OF_RUNS = ("skillframe.execution.trace", "skillframe.execution.result")


def test_reports_are_made_from_files_and_never_from_a_world():
    above = {"control", "cosim", "world", "robot", "fmu"}
    found = [
        f"{relative(p)}:{line} {m}"
        for p in sorted((ROOT / "plugins" / "reports" / "src").rglob("*.py"))
        if p.name != "outputs.py"  # draws scenes, too
        for line, m in imports(p)
        if own(m) in above or (own(m) == "execution" and not m.startswith(FILES_OF_RUNS))
    ]
    assert not found


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda p: p.name)
def test_a_plugin_imports_public_names_of_the_core_and_no_other_plugin_but_those_it_declares(plugin):
    packages = {p.name.removesuffix(".py") for p in (plugin / "src").iterdir()} | declared(plugin)
    wrong = []
    for path in sorted((plugin / "src").rglob("*.py")):
        for line, module in imports(path, False):
            first = module.split(".")[0]
            other = first.startswith("skillframe_") and first not in packages
            private = first == "skillframe" and any(part.startswith("_") for part in module.split("."))
            typed = own(module) == "cli" and not module.startswith(FOR_COMMANDS)
            if other or private or typed:
                wrong.append(f"{relative(path)}:{line} {module}")
    assert not wrong, "a plug-in asks the registry, and never the command line: " + "; ".join(wrong)


FOR_COMMANDS = tuple(f"skillframe.cli.{name}" for name in ("output", "options", "main.run"))
"""What the commands of plug-ins are made of."""


def declared(plugin):
    """Packages of the plug-ins that a plug-in's pyproject.toml says it depends on."""
    project = tomllib.loads((plugin / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = {re.match(r"[\w-]+", requirement).group().replace("-", "_") for requirement in project["dependencies"]}
    return {name for name in names if name.startswith("skillframe_")}


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda p: p.name)
def test_a_plugin_declares_no_plugin_that_it_does_not_import(plugin):
    found = {m.split(".")[0] for p in (plugin / "src").rglob("*.py") for _, m in imports(p, False)}
    assert declared(plugin) <= found


BANNED_IMPORTS = {
    "logging",
    "pluggy",
    "rich",
    "click",
    "time",
    "datetime",
    "random",
    "io",
    "json",
    "csv",
    "tomllib",
    "shutil",
}
BANNED_IMPORTS |= {"tempfile", "subprocess", "warnings"}
BANNED_CALLS = re.compile(
    r"^(print|open|input)$|\.(open|read_text|write_text|read_bytes|write_bytes)$|^(np|numpy)\.(load|save|savez\w*|loadtxt|savetxt)$"
    r"|^sys\.(stdout|stderr)\.write$"
)
HANDED_IN = {"Generator", "SeedSequence", "default_rng"}


@pytest.mark.parametrize("path", loop_files(), ids=relative)
def test_what_runs_in_the_loop_prints_logs_reads_and_asks_nothing(path):
    found = [f"line {line}: import {m}" for line, m in imports(path) if m.split(".")[0] in BANNED_IMPORTS]
    found += [f"line {line}: {name}(...)" for line, name in facts(path).calls if BANNED_CALLS.search(name)]
    found += [
        f"line {line}: asks the registry" for line, m in imports(path) if m.startswith("skillframe.extend.registry")
    ]
    assert not found, f"{relative(path)}: {'; '.join(found)} (set-up belongs in a module of SET_UP)"


@pytest.mark.parametrize("path", loop_files(), ids=relative)
def test_chance_in_the_loop_comes_from_a_generator_only(path):
    used = {m.group(1) for m in re.finditer(r"\bnp\.random\.(\w+)", path.read_text())}
    assert used <= HANDED_IN, f"{relative(path)} uses numpy's global generator: {used - HANDED_IN}"


@pytest.mark.parametrize("path", loop_files(), ids=relative)
def test_slow_calls_stay_out_of_the_loop(path):
    slow = [f"line {line}: {m}" for line, m in imports(path) if m.startswith("scipy.spatial")]
    slow += [f"line {line}: {name}; see skillframe.frames" for line, name in facts(path).calls if name in SLOW]
    assert not slow, f"{relative(path)}: {'; '.join(slow)}"


SLOW = {"np.cross", "numpy.cross", "np.linalg.norm", "numpy.linalg.norm", "Rotation.from_matrix", "Rotation.from_quat"}


def tracked(pattern):
    """Files in version control, and new ones that are not ignored; every file where git is missing."""
    try:
        command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", pattern]
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listed if (ROOT / name).is_file()]


def test_no_python_file_is_longer_than_400_lines():
    long = {relative(p): n for p in tracked("*.py") if (n := len(p.read_text(encoding="utf-8").splitlines())) > 400}
    assert not long


def test_no_file_names_a_machine_path_or_a_package_registry():
    places = "|".join(("/" + "work/", "/" + "root/", "/" + "tmp/", "/" + "home/"))
    hosts = "|".join(("pypi" + r"\.org", "python" + r"hosted\.org", "npm" + r"js\.org", "deb" + r"ian\.org"))
    forbidden = re.compile(rf"(?<![\w.$~}}])({places})|{hosts}")
    found = []
    for path in tracked("*"):
        content = path.read_bytes()
        if b"\0" not in content[:8000]:
            lines = content.decode("utf-8", errors="replace").splitlines()
            found += [
                f"{relative(path)}:{i}: {line[:120]}" for i, line in enumerate(lines, 1) if forbidden.search(line)
            ]
    assert not found, "\n".join(found)


def every_command():
    """(words, command) of every command and subcommand."""
    from skillframe.cli.main import cli

    def below(words, command):
        yield words, command
        if isinstance(command, click.Group):
            context = click.Context(command)
            for name in command.list_commands(context):
                yield from below([*words, name], command.get_command(context, name))

    return list(below([], cli))


def test_every_command_has_help_with_an_example():
    lacking = [" ".join(["skillframe", *words]) for words, c in every_command() if "Example" not in (c.help or "")]
    assert not lacking


def test_every_command_that_lists_has_json():
    listing = {"robots", "worlds", "skills", "fmu", "plugins", "export", "doctor"}
    found = {words[0]: {o for p in c.params for o in p.opts} for words, c in every_command() if len(words) == 1}
    assert not [name for name in listing if "--json" not in found[name]]


def test_scalar_products_of_trials_are_summed_in_order():
    """`np.vecdot` gives each to BLAS, which rounds by processor and memory alignment; `frames.dot` does not."""
    files = [*core_files(), *(p for p in (ROOT / "plugins").glob("*/src/**/*.py"))]
    assert not [relative(p) for p in files if "vecdot(" in p.read_text(encoding="utf-8")]
