import json
import re
import sys
from importlib import metadata

import pytest

from skillframe.cli import doctor
from skillframe.cli.main import run
from skillframe.errors import EXTRAS


@pytest.fixture(autouse=True)
def no_drawing(monkeypatch):
    """Whether OpenGL draws takes seconds to find out; `plugins/reports/tests/test_opengl.py` does."""
    monkeypatch.setattr("skillframe_reports.opengl.backend", lambda: "egl")


def findings(capsys, code=0):
    assert run(["doctor", "--json"]) == code
    return {row["name"]: row for row in json.loads(capsys.readouterr().out)}


def test_json_is_alone_on_stdout_and_every_missing_thing_has_what_to_type(capsys):
    rows = findings(capsys)
    for row in rows.values():
        assert row.keys() == {"name", "found", "needed_for", "required", "fix"}
        assert row["found"] or row["fix"]


def test_every_declared_dependency_and_every_extra_is_looked_at(capsys):
    rows = findings(capsys)
    for requirement in metadata.requires("skillframe"):
        library, extra = re.match(r"[\w.-]+", requirement).group(), re.search(r"extra == ['\"](\w+)", requirement)
        if extra is None:
            assert rows[library]["required"]
        elif extra.group(1) != "all":
            row = rows[f"skillframe[{extra.group(1)}]"]
            assert library in row["found"] + row["fix"] and row["needed_for"] == EXTRAS[extra.group(1)]


@pytest.mark.needs_plugins
def test_the_extras_of_a_plugin_are_looked_at(capsys):
    assert {"skillframe-baselines[dmp]", "skillframe-baselines[seds]"} <= findings(capsys).keys()


def versions(monkeypatch, **changed):
    """Let libraries have other versions; None for one that is not installed."""
    real = metadata.version

    def version(name):
        if changed.get(name, "") is None:
            raise metadata.PackageNotFoundError(name)
        return changed.get(name) or real(name)

    monkeypatch.setattr(metadata, "version", version)


def test_a_missing_library_of_the_core_is_required_and_exits_1(capsys, monkeypatch):
    versions(monkeypatch, scipy=None)
    row = findings(capsys, code=1)["scipy"]
    assert row["found"] == ""
    assert row["fix"].startswith(sys.executable) and "scipy>=1.13" in row["fix"]


def test_a_missing_library_of_an_extra_is_not_required_and_the_extra_installs_it(capsys, monkeypatch):
    versions(monkeypatch, mujoco=None)
    rows = findings(capsys)
    assert rows["skillframe[sim]"]["found"] == f"pin {metadata.version('pin')}"
    assert rows["skillframe[sim]"]["fix"] == f"{sys.executable} -m pip install 'skillframe[sim]'  # lacks mujoco>=4.0"
    assert "lacks mujoco>=4.0" in rows["skillframe[crane]"]["fix"]
    assert not rows["skillframe[parts]"]["fix"]


def test_a_library_that_is_too_old_is_told_with_both_versions(capsys, monkeypatch):
    versions(monkeypatch, mujoco="3.9.9", numpy="1.26.4")
    rows = findings(capsys, code=1)
    assert "mujoco 3.9.9" in rows["skillframe[sim]"]["found"] and "mujoco>=4.0" in rows["skillframe[sim]"]["fix"]
    assert rows["numpy"]["found"] == "1.26.4" and "numpy>=2.0" in rows["numpy"]["fix"]


def test_versions_are_compared_as_numbers():
    assert doctor._numbers("2025.10.1") > doctor._numbers("2025.9.30")
    assert doctor._numbers("4.0.0rc1") >= doctor._numbers("4.0")


def test_nothing_but_the_core_is_required(capsys, monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    monkeypatch.setattr(doctor, "find_spec", lambda name: None)
    monkeypatch.delenv("SKILLFRAME_RECORDINGS", raising=False)
    rows = findings(capsys, code=0)
    for name in ("C compiler", "browser", "recordings"):
        assert rows[name]["found"] == "" and rows[name]["fix"] and not rows[name]["required"]
    assert "pip install ziglang" in rows["C compiler"]["fix"]


def test_ziglang_counts_as_a_compiler(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    monkeypatch.setattr(doctor, "find_spec", lambda name: object())
    assert doctor._compiler().found == "ziglang"


def test_a_recordings_folder_that_is_not_there_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("SKILLFRAME_RECORDINGS", str(tmp_path / "gone"))
    assert "is no folder" in doctor._recordings().fix
    monkeypatch.setenv("SKILLFRAME_RECORDINGS", str(tmp_path))
    assert doctor._recordings().found == str(tmp_path)


def test_a_broken_plugin_is_told_with_its_error(monkeypatch, fresh_registry):
    from skillframe.extend.registry import registry

    registry().plugins[0].error = "ValueError: oh"
    assert "ValueError: oh" in next(doctor._plugins()).fix


def test_for_people_there_is_a_table_and_a_line_for_each_missing_thing(capsys, monkeypatch):
    monkeypatch.delenv("SKILLFRAME_RECORDINGS", raising=False)
    assert run(["doctor"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("what") and "numpy" in text
    assert "recordings: export SKILLFRAME_RECORDINGS=FOLDER" in text
