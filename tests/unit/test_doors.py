"""The import paths of 0.1 still open, name the new ones, and give the same classes."""

import importlib
import subprocess
import sys

import pytest

from skillframe import doors


@pytest.mark.parametrize("old", doors.MOVED)
def test_an_old_import_path_gives_the_module_of_the_new_one(old):
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} is {doors.MOVED[old]} now"):
        found = importlib.import_module(old)
    assert found is importlib.import_module(doors.MOVED[old])
    assert found.__name__ == found.__spec__.name == doors.MOVED[old]


def test_the_warning_names_the_line_of_the_plugin(tmp_path):
    (tmp_path / "old_plugin.py").write_text("import math\nfrom skillframe.records import SkillType\n")
    program = [sys.executable, "-W", "default", "-c", "import old_plugin"]
    said = subprocess.run(program, capture_output=True, text=True, cwd=tmp_path, check=True).stderr
    assert "old_plugin.py:2: DeprecationWarning: skillframe.records is skillframe.extend.records now" in said


def test_a_path_that_never_was_stays_unknown():
    with pytest.raises(ModuleNotFoundError, match=r"skillframe\.actuation\.nothing"):
        importlib.import_module("skillframe.actuation.nothing")
