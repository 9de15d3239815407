"""Extras: what installs what, and that a missing one is a sentence with the line to type."""

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

import skillframe
from skillframe.errors import EXTRAS, LIBRARIES, MissingDependency, extras_named, missing_extra, need
from tests.first_lines import statements

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = PROJECT["optional-dependencies"]


def names(requirements):
    return {re.match(r"[\w.-]+", each).group() for each in requirements}


def test_every_extra_says_what_it_is_for():
    assert {name for name in EXTRAS if "[" not in name} == OPTIONAL.keys() - {"all"}


def installed_by(extra):
    """What an extra installs, of the core or, named in full, of another distribution."""
    if "[" not in extra:
        return names(OPTIONAL[extra])
    distribution, _, name = extra.removesuffix("]").partition("[")
    toml = ROOT / "plugins" / distribution.removeprefix("skillframe-") / "pyproject.toml"
    return names(tomllib.loads(toml.read_text(encoding="utf-8"))["project"]["optional-dependencies"][name])


LARGE = {"step"}
"""Not in the extra all: what most people never need, and what is large."""


def test_the_extra_all_is_all_others_together_but_the_large_ones():
    small = OPTIONAL.keys() - LARGE - {"all"}
    assert sorted(OPTIONAL["all"]) == sorted({each for name in small for each in OPTIONAL[name]})


def test_every_library_is_named_with_an_extra_that_installs_it():
    assert all(library in installed_by(extra) for library, extra in LIBRARIES.values())
    assert {library for library, _ in LIBRARIES.values()} == set().union(*map(installed_by, EXTRAS))


def imported(path):
    """Modules at top level that a file imports, wherever it does."""
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("place", ["skillframe", *(f"plugins/{p.name}/src" for p in (ROOT / "plugins").glob("*/"))])
@pytest.mark.slow
def test_whatever_is_imported_is_declared(place):
    toml = ROOT / Path(place).parent / "pyproject.toml"
    if not toml.is_file():
        pytest.skip("no distribution")
    project = tomllib.loads(toml.read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *project.get("optional-dependencies", {}).values()]
    through_core = names(PROJECT["dependencies"]) if place != "skillframe" else set()
    through_core |= names(OPTIONAL["sim"]) if any("skillframe[sim]" in each for each in lists[0]) else set()
    declared = {name.replace("-", "_") for each in lists for name in names(each)} | through_core
    modules = {module for path in (ROOT / place).rglob("*.py") for module in imported(path)}
    own = {"yaml"} | {p.name for p in (ROOT / place).iterdir()} | {m for m in modules if m.startswith("skillframe")}
    foreign = modules - sys.stdlib_module_names - own
    named = {"rtde_control": "ur_rtde", "rtde_receive": "ur_rtde"}  # modules that are not named as their library
    assert {LIBRARIES.get(module, (named.get(module, module), ""))[0] for module in foreign} <= declared


def test_a_module_of_no_extra_is_not_explained():
    assert missing_extra("numpy") is None
    need("not_there")  # says nothing of what no extra installs
    with pytest.raises(ModuleNotFoundError, match="not_there"), extras_named():
        import not_there  # noqa: F401


def test_a_missing_module_within_a_library_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco.batch", None)
    with (
        pytest.raises(MissingDependency, match=r"needs mujoco, .* type: pip install 'skillframe\[sim\]'"),
        extras_named(),
    ):
        import mujoco.batch  # noqa: F401


def without(hidden, *words, code=2, plugins=""):
    """What the command line says on stderr, in a process in which libraries are not installed."""
    script = (
        f"import sys; sys.modules.update(dict.fromkeys({list(hidden)!r}))\n"
        f"from skillframe.cli.main import run; sys.exit(run({[str(word) for word in words]!r}))"
    )
    environment = {**os.environ, "SKILLFRAME_PLUGINS": plugins, "SKILLFRAME_STRICT_PLUGINS": "1"}
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == code, run.stderr
    return run.stderr.strip()


def test_without_a_simulator_a_command_that_needs_one_says_what_to_type(tmp_path):
    skill = ROOT / "docs" / "how-to" / "corner.skill.json"
    for words in (
        ["robots", "panda"],
        ["record", "--world", "valley", "--out", tmp_path / "a.npz"],
    ):
        said = without(["mujoco", "pinocchio"], *words)
        assert re.fullmatch(
            r"error: .* needs (mujoco|pin), which is not .*; type: pip install 'skillframe\[sim\]'", said
        )
    said = without(["mujoco"], "run", skill, "--world", "free", "--out", tmp_path / "a.npz")
    assert said == f"error: {missing_extra('mujoco')}"


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_without_casadi_demonstrations_of_an_arm_are_recorded():
    code = "import sys; sys.modules['casadi'] = None\n"
    code += "from skillframe import record; record('hose_coupler', 'free_tool')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_without_its_libraries_a_video_is_refused_before_the_run(tmp_path):
    words = ["run", "none.json", "--world", "valley", "--video", tmp_path / "a.mp4"]
    said = without(["av"], *words, plugins="reports")
    assert said == f"error: {missing_extra('av')}"


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_without_worker_processes_the_demo_is_refused_before_it_writes(tmp_path):
    said = without(["distributed"], "demo", "--out", tmp_path / "demo", plugins="reports")
    assert said == f"error: {missing_extra('distributed')}"
    assert not (tmp_path / "demo").exists()


def test_without_fmpy_an_fmu_says_what_to_type(tmp_path):
    file = tmp_path / "a.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='2.0'/>")
    assert without(["fmpy"], "fmu", file) == f"error: {missing_extra('fmpy')}"


LEARN_WITHOUT_EXTRAS = """
from pathlib import Path
from skillframe.cli.main import run
from skillframe_testkit.checks.examples import example_demonstrations
from skillframe.extend.reading import write_demonstration
files = ["left.csv", "right.csv"]
for file, demonstration in zip(files, example_demonstrations()):
    write_demonstration(demonstration, Path(file))
assert run(["check", *files]) == 0
assert run(["filter", "left.csv", "--out", "clean.npz"]) == 0
assert run(["learn", *files, "--out", "slide.json"]) == 0
assert run(["show", "slide.json"]) == 0
assert run(["show", "slide.json", "--page", "slide.html"]) == 0
assert run(["export", "slide.json", "--to", "crisp", "--coc", "0,0,0", "--out", "slide.yaml"]) == 0
assert run(["plugins"]) == run(["doctor"]) == run(["worlds"]) == 0
"""


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_reading_a_table_learning_explaining_and_exporting_need_no_extra(tmp_path):
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({list(LIBRARIES.keys() - {'PIL'})!r}))\n{LEARN_WITHOUT_EXTRAS}"
    )
    environment = {**os.environ, "SKILLFRAME_PLUGINS": "lmc,recordings,reports"}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=tmp_path, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "push along" in run.stdout


def test_a_public_name_that_needs_an_extra_names_it(monkeypatch):
    monkeypatch.setitem(skillframe._PUBLIC, "anything", "mujoco.batch")
    monkeypatch.setitem(sys.modules, "mujoco.batch", None)
    with pytest.raises(MissingDependency, match=r"skillframe\[sim\]"):
        _ = skillframe.anything


PAGE = (ROOT / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")


def test_the_page_on_installing_says_what_every_extra_brings():
    for extra in EXTRAS:
        whole = extra if "[" in extra else f"skillframe[{extra}]"
        (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{whole}`")]
        assert installed_by(extra) - {"lxml"} == {name.strip() for name in row.split("|")[3].split(",")}


def test_a_csv_reader_and_lmc_need_under_400_mb():
    """The files of everything that the two distributions depend on, as they are installed here."""
    found, waiting = {}, sorted(names(PROJECT["dependencies"]))
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue  # of another system or Python
        files = [file.locate() for file in distribution.files or []]
        found[name] = sum(Path(file).stat().st_size for file in files if Path(file).is_file())
        waiting += [
            re.match(r"[\w.-]+", each).group() for each in distribution.requires or [] if "extra ==" not in each
        ]
    assert {"numpy", "scipy", "matplotlib"} <= found.keys()
    assert sum(found.values()) < 400e6, found
