"""Habits that hold for every distribution: types, linters in CI and before a commit, platforms, and how to cite."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import skillframe

ROOT = Path(__file__).resolve().parents[2]
PROJECTS = [ROOT, *sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))]


def project(folder):
    return tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))


def packages(folder):
    return [folder / name for name in project(folder)["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]]


def recipe(target):
    """Command lines of a target of the Makefile, without the folder of the tools."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    lines = re.search(rf"^{target}:.*\n((?:\t.*\n)+)", text, re.MULTILINE).group(1)
    return [line.strip().replace("$(BIN)/", "") for line in lines.splitlines()]


def test_there_are_twenty_two_distributions():
    assert len(PROJECTS) == 22


def test_all_are_installed_for_every_day_but_what_drags_lerobot_in():
    text = (ROOT / "plugins" / "all.txt").read_text(encoding="utf-8")
    everyday = re.findall(r"^-e plugins/(\w+)", text, re.MULTILINE)
    assert {folder.name for folder in PROJECTS[1:]} - {*everyday} == {"lerobot"}


@pytest.mark.parametrize("folder", PROJECTS, ids=lambda path: path.name)
def test_every_package_says_that_it_is_typed(folder):
    assert all((package / "py.typed").is_file() for package in packages(folder))


@pytest.mark.parametrize("folder", PROJECTS, ids=lambda path: path.name)
def test_every_package_is_type_checked_strictly(folder):
    settings = project(ROOT)["tool"]["mypy"]
    read = [path for pattern in settings["files"] for path in ROOT.glob(pattern)]
    assert settings["strict"] is True and "exclude" not in settings
    assert all(any(package.is_relative_to(path) for path in read) for package in packages(folder))


@pytest.mark.parametrize("folder", PROJECTS, ids=lambda path: path.name)
def test_every_distribution_says_on_what_it_runs(folder):
    assert {"Operating System :: POSIX :: Linux", "Typing :: Typed"} <= set(project(folder)["project"]["classifiers"])


def test_ci_runs_the_linters_and_builds_the_docs():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert {"lint", "test", "test-slow", "docs"} <= set(re.findall(r"^make ([\w-]+)$", script, re.MULTILINE))


def test_what_runs_before_a_commit_is_what_make_lint_runs():
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    typed = [" ".join([hook["entry"], *hook.get("args", ())]) for hook in local["hooks"]]
    assert local["repo"] == "local"
    assert [words.removeprefix(".venv/bin/") for words in typed] == recipe("lint")


def test_the_citation_names_this_version_and_every_reference_has_what_its_format_asks_for():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(cited["version"]) == skillframe.__version__ == project(ROOT)["project"]["version"]
    assert {"cff-version", "message", "title", "authors"} <= cited.keys()
    assert all({"type", "title", "authors"} <= reference.keys() for reference in cited["references"])


@pytest.mark.parametrize("folder", PROJECTS, ids=lambda path: path.name)
def test_every_distribution_has_the_version_of_the_core(folder):
    assert project(folder)["project"]["version"] == skillframe.__version__


@pytest.mark.parametrize("place", [f"plugins/{folder.name}/pyproject.toml" for folder in PROJECTS[1:]])
def test_a_plugin_asks_for_this_minor_version_of_the_core_and_not_the_next(place):
    text = (ROOT / place).read_text(encoding="utf-8")
    major, minor = map(int, skillframe.__version__.split(".")[:2])
    asked = re.findall(r"\"skillframe(?:\[[a-z,]+\])?(>=[^\"]*)\"", text)
    assert asked == [f">={major}.{minor},<{major}.{minor + 1}"]
