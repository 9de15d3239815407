"""What is told of files that foreign code writes: its own, and not those of the interpreter."""

import importlib
import os
import sys

from skillframe_testkit.checks.watch import watched

from skillframe.files import cache_dir


def test_a_module_that_is_compiled_when_it_is_imported_is_no_deed(tmp_path, monkeypatch):
    """The interpreter opens the compiled file by its path, and the descriptor once more."""
    (tmp_path / "fresh_module_of_a_plugin.py").write_text("VALUE = 1\n")
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.syspath_prepend(str(tmp_path))
    with watched() as seen:
        importlib.import_module("fresh_module_of_a_plugin")
    monkeypatch.delitem(sys.modules, "fresh_module_of_a_plugin")
    assert [*tmp_path.glob("__pycache__/*.pyc")]  # it was written
    assert not seen.deeds


def test_a_file_that_is_opened_by_its_number_was_told_by_its_path(tmp_path):
    with watched() as seen:
        number = os.open(tmp_path / "own.txt", os.O_WRONLY | os.O_CREAT)
        with open(number, "wb") as file:
            file.write(b"x")
    assert seen.deeds == ["opens the file 'own.txt' for writing"]


def test_what_we_cache_while_foreign_code_runs_is_no_deed_of_it(tmp_path, monkeypatch):
    """A world of meshes is cut into pieces once, whoever asks for it first."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with watched() as seen:
        (cache_dir("pieces") / "one.json").write_text("{}")
        (tmp_path / "own.json").write_text("{}")
    assert seen.deeds == ["opens the file 'own.json' for writing"]
