"""What `plugins new` writes: any kinds together, light to list, and sound until a defect is planted."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from skillframe_testkit.template import KINDS, TEMPLATE

from skillframe import __version__
from skillframe.cli.main import run
from skillframe.extend.contract import CONTRACT, requirement_problem
from skillframe.extend.registry import KINDS as RECORDS

HEAVY = {"scipy", "casadi", "fmpy", "filterpy", "mujoco", "matplotlib", "pinocchio"}
NAME = "glide_slowly"
PACKAGE = f"skillframe_{NAME}"


def installed(folder, site):
    """Environment in which the plug-in of a folder is installed, built as a wheel by pip."""
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, folder]
    subprocess.run(install, check=True, timeout=300)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    environment.pop("SKILLFRAME_PLUGINS", None)
    return environment


def made(folder, *kinds):
    options = [word for kind in kinds for word in ("--kind", kind)]
    assert run(["plugins", "new", NAME, "--out", str(folder), "-q", *options]) == 0
    return folder


def test_there_is_a_template_for_every_hook_but_those_of_whole_distributions():
    assert {*KINDS, "row", "world_file", "audit", "output", "folder", "requirement", "link", "teacher"} == set(RECORDS)
    assert {path.name for path in (TEMPLATE / "kinds").iterdir()} == set(KINDS)


def test_only_the_kinds_that_are_asked_for_are_written(tmp_path):
    folder = made(tmp_path / "two", "score", "robot")
    package = folder / "src" / PACKAGE
    assert {p.name for p in package.iterdir()} == {"__init__.py", "py.typed", "score.py", "robots"}
    assert (package / "robots" / NAME / "robot.toml").is_file()
    assert {p.name for p in (folder / "tests").iterdir()} == {f"test_{NAME}_score.py", f"test_{NAME}_robot.py"}
    hooks = re.findall(r"def (skillframe_\w+)", (package / "__init__.py").read_text())
    assert hooks == ["skillframe_scores", "skillframe_robots"]
    assert "a score and a robot" in (folder / "README.md").read_text()


def test_an_unknown_kind_is_refused_with_those_there_are(tmp_path, capsys):
    assert run(["plugins", "new", NAME, "--kind", "scroe", "--out", str(tmp_path / "x")]) == 2
    assert "'score'" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_a_plugin_of_every_kind_parses_has_no_placeholder_left_and_names_contract_and_versions(tmp_path):
    folder = made(tmp_path / "all", "all")
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert not [p for p in files if "@" in p.name or re.search(r"@[A-Z]+@", p.read_text())]
    for path in files:
        if path.suffix == ".py":
            compile(path.read_text(), str(path), "exec")
    assert f'skillframe_contract = "{CONTRACT}"' in (folder / "src" / PACKAGE / "__init__.py").read_text()
    (wanted,) = re.findall(r'"(skillframe[^"]*)", "numpy', (folder / "pyproject.toml").read_text())
    assert wanted != "skillframe" and requirement_problem([wanted], __version__) == ""


LIST = """
import sys
from skillframe.extend.registry import Plugin, Registry
from importlib import import_module
known = Registry()
plugin = known.add(Plugin(name="own", distribution="own", version="1"), lambda: import_module("{package}"))
assert plugin.error is None, plugin.error
print(" ".join(plugin.provides))
print(" ".join({{m.partition(".")[0] for m in sys.modules}}))
"""


@pytest.mark.slow
def test_listing_a_plugin_of_every_kind_loads_no_heavy_library(tmp_path):
    folder = made(tmp_path / "all", "all")
    code = LIST.format(package=PACKAGE)
    environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    provides, modules = done.stdout.splitlines()
    assert {each.partition(":")[0] for each in provides.split()} == set(KINDS)
    assert not set(modules.split()) & HEAVY


DEFECTS = {
    "skill": ("skill.py", 'reason[ended] = "reached the end of the line"', "pass", "comes with the reason ''"),
    "segmenter": ("segmenter.py", "list(range(count))", "list(range(count + 1))", "3 labels for 2 intervals"),
    "world": ("world.py", "start_tip=(0.0, 0.0, 0.02)", "start_tip=(0.0, 0.0, -0.01)", "deep in the fixture"),
    "coordinator": ("coordinator.py", "self._home.position + progress", "0.1 + self._home.position + progress", "bump"),
    "reader": ("reader.py", "except OSError as", "except EOFError as", "a file that is missing raises"),
    "exporter": ("exporter.py", "phase.lead_force,", "1e999,", "Out of range float values"),
    "score": ("score.py", "return float(", "return 1.0 / len(steps) + float(", "one sample: raised Zero"),
    "robot": (f"robots/{NAME}/{NAME}.urdf", "<inertial>", "<inertial_of_another_tool>", "dynamics: "),
    "drive": ("__init__.py", "drive:make", "drive:mkae", "raised AttributeError"),
    "section": ("section.py", 'f"Of {len(rows)} rows."', 'f"<b>{len(rows)} rows</b>"', "holds markup, '<b>'"),
}  # fmt: skip
CHECK = """
import sys
from skillframe_testkit.checks.plugins import CHECKS
from skillframe.extend.registry import registry
kind, name = sys.argv[1:]
print("\\n".join(CHECKS[kind](registry().record(kind, name))))
"""


@pytest.mark.slow
def test_a_wheel_with_one_of_each_hook_passes_its_suite_and_every_planted_defect_is_named(tmp_path):
    folder, site = made(tmp_path / "plugin", "all"), tmp_path / "site"
    environment = installed(folder, site)
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", folder / "tests"]
    done = subprocess.run(tests, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    check = [sys.executable, "-m", "skillframe.cli.main", "plugins", "check", NAME, "--json"]
    done = subprocess.run(check, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {row["subject"].partition(":")[0] for row in json.loads(done.stdout)} == {"plug-in", *KINDS}
    assert set(DEFECTS) == set(KINDS)
    for kind, (file, sound, spoiled, said) in DEFECTS.items():
        path = site / PACKAGE / file
        before = path.read_text()
        assert sound in before, (kind, sound)
        path.write_text(before.replace(sound, spoiled).replace(f"</{sound[1:]}", f"</{spoiled[1:]}"))
        name = f"{NAME}_arms" if kind == "coordinator" else NAME
        one = [sys.executable, "-B", "-c", CHECK, kind, name]
        found = subprocess.run(one, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        path.write_text(before)
        assert said in found.stdout, f"{kind}: {found.stdout or found.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_plugin_of_any_one_kind_loads_and_conforms(kind, tmp_path):
    folder = made(tmp_path / "plugin", kind)
    info = tmp_path / "site" / f"{PACKAGE}-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: skillframe-{NAME}\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text(f"[skillframe]\n{NAME} = {PACKAGE}\n")
    paths = os.pathsep.join([str(tmp_path / "site"), str(Path(folder) / "src")])
    environment = {**os.environ, "PYTHONPATH": paths, "SKILLFRAME_PLUGINS": f"testkit,worlds,{NAME}"}
    check = [sys.executable, "-m", "skillframe.cli.main", "plugins", "check", NAME]
    done = subprocess.run(check, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"  {kind}:{NAME}" in done.stdout and "passes" in done.stdout
