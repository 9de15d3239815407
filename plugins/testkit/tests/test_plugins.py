import json
import subprocess
import sys

import pytest
from skillframe_testkit.suites import HoldSkill
from skillframe_testkit.template import plugin_name

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend import SkillType
from skillframe.extend.registry import Plugin, Registry, registry

BROKEN = """
from skillframe import hookimpl
from skillframe.extend import SkillType
@hookimpl
def skillframe_skills():
    yield SkillType(name="nothing", summary="does nothing", build=lambda document: None, example=dict)
"""


@pytest.fixture
def made(tmp_path, monkeypatch, fresh_registry):
    """A plug-in from the template, on the path as an installed one is; its folder."""
    folder = tmp_path / "glide"
    assert run(["plugins", "new", "glide_slowly", "--out", str(folder)]) == 0
    info = tmp_path / "site" / "skillframe_glide_slowly-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: skillframe-glide-slowly\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text("[skillframe]\nglide_slowly = skillframe_glide_slowly\n")
    for path in (tmp_path / "site", folder / "src"):
        monkeypatch.syspath_prepend(path)
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "testkit,worlds,glide_slowly")
    yield folder
    for name in [n for n in sys.modules if n.startswith("skillframe_glide_slowly")]:
        del sys.modules[name]


def listed(capsys):
    capsys.readouterr()
    assert run(["plugins", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_json_is_alone_on_stdout_and_has_the_contract_s_keys(capsys, fresh_registry, monkeypatch):
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "no_such_plugin,worlds")
    rows = listed(capsys)
    for row in rows:
        assert row.keys() == {"name", "distribution", "version", "provides", "error"}
        assert isinstance(row["distribution"], str)
        assert row["error"] is None or isinstance(row["error"], str)
    assert rows[0]["distribution"] == "skillframe"
    assert "reader:npz" in rows[0]["provides"]


def test_a_plugin_that_is_asked_for_and_missing_is_told_on_stderr(capsys, fresh_registry, monkeypatch):
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "no_such_plugin")
    assert run(["plugins"]) == 0
    assert "'no_such_plugin', which is not installed" in capsys.readouterr().err


def test_a_distribution_with_two_plugins_is_one_row():
    from skillframe.cli.plugins import distribution_rows

    known = Registry()
    for name in ("a", "b"):
        known.plugins.append(
            Plugin(name=name, distribution="both", version="1", provides=[f"skill:{name}"], error=name)
        )
    assert distribution_rows(known) == [
        {"name": "a,b", "distribution": "both", "version": "1", "provides": ["skill:a", "skill:b"], "error": "a; b"}
    ]


@pytest.mark.slow
def test_a_plugin_made_by_new_is_found_and_passes_its_checks(made, capsys):
    row = next(r for r in listed(capsys) if r["name"] == "glide_slowly")
    assert row == {
        "name": "glide_slowly", "distribution": "skillframe-glide-slowly", "version": "0.1.0",
        "provides": ["skill:glide_slowly"], "error": None,
    }  # fmt: skip
    assert "skillframe_glide_slowly.skill" not in sys.modules  # a listing imports the entry module alone
    assert run(["plugins", "check", "glide_slowly"]) == 0
    assert "skill:glide_slowly: passes" in capsys.readouterr().out


@pytest.mark.slow
def test_a_plugin_made_by_new_passes_its_own_tests_wherever_it_lies(made):
    (made.parent / "conftest.py").write_text("raise ImportError('of another project')\n")
    (made.parent / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    code = f"import sys; sys.path[:0] = {[str(made / 'src'), str(made.parent / 'site')]}\nimport pytest\n"
    code += "sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', 'tests']))"
    done = subprocess.run([sys.executable, "-c", code], cwd=made, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_plugin_made_by_new_leaves_no_placeholder_behind(made):
    files = [p for p in made.rglob("*") if p.is_file() and p.suffix != ".pyc"]
    assert {p.name for p in files} >= {"pyproject.toml", "README.md", "__init__.py", "skill.py", "test_glide_slowly.py"}
    assert not [p for p in files if "@" in p.name or "@PACKAGE@" in p.read_text() or "@NAME@" in p.read_text()]


def test_check_exits_1_and_says_what_fails(made, capsys):
    (made / "src" / "skillframe_glide_slowly" / "__init__.py").write_text(BROKEN)
    assert run(["plugins", "check", "glide_slowly"]) == 1
    text = capsys.readouterr().out
    assert "skill:nothing: FAILS" in text
    assert "build gave NoneType, not a skillframe.Skill" in text


def test_check_fails_a_plugin_that_does_not_load(made, capsys):
    (made / "src" / "skillframe_glide_slowly" / "__init__.py").write_text("import no_such_module")
    assert run(["plugins", "check", "glide_slowly", "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert rows[0]["subject"] == "plug-in"
    assert "no_such_module" in rows[0]["problems"][0]


def test_check_refuses_a_name_that_is_not_installed(made, capsys):
    assert run(["plugins", "check", "glide_slowli"]) == 2
    assert "did you mean 'glide_slowly'?" in capsys.readouterr().err


def test_a_plugin_can_be_checked_by_the_name_of_its_distribution(made):
    spoiled(made, "")  # there is nothing else to check
    assert run(["plugins", "check", "skillframe-glide-slowly"]) == 0


def test_new_refuses_a_folder_that_holds_something(made, capsys):
    assert run(["plugins", "new", "other", "--out", str(made)]) == 2
    assert "not an empty folder" in capsys.readouterr().err


def test_new_writes_beside_where_one_stands_unless_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["plugins", "new", "My-Skill"]) == 0
    assert (tmp_path / "skillframe-my-skill" / "src" / "skillframe_my_skill" / "skill.py").exists()


@pytest.mark.parametrize(
    ("text", "name"),
    [("my_skill", "my_skill"), ("My-Skill", "my_skill"), ("skillframe-x", "x"), ("a b", "a_b"), ("p2", "p2")],
)
def test_names_become_what_python_and_file_systems_like(text, name):
    assert plugin_name(text) == name


@pytest.mark.parametrize("text", ["", "2p", "class", "a/b", "..", "ä", "skillframe_"])
def test_what_cannot_name_a_module_is_refused(text):
    with pytest.raises(InputError, match="is not a name"):
        plugin_name(text)


@pytest.mark.slow
def test_a_skill_that_conforms_passes_in_a_registry_made_by_hand():
    from skillframe_testkit.checks import check_plugin

    module = type("module", (), {})
    known = Registry()
    plugin = known.add(Plugin(name="hand", distribution="hand", version="1"), lambda: module)
    hold = SkillType(
        name="hold", summary="holds", build=lambda d: HoldSkill(), describe=lambda d: ["hold"], example=dict
    )
    known._keep("skill", hold, plugin)
    assert [f.problems for f in check_plugin(known, plugin)] == [[], []]


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_every_installed_plugin_conforms(fresh_registry):
    from skillframe_testkit.checks import check_plugin

    known = registry()
    problems = {f.subject: f.problems for p in known.plugins for f in check_plugin(known, p) if f.problems}
    assert not problems


def test_show_says_what_can_be_set_of_a_world_with_defaults_and_meaning(capsys):
    assert run(["plugins", "peg_in_hole", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["kind"], row["distribution"]) == ("world", "skillframe-worlds")
    settings = {each["name"]: each for each in row["settings"]}
    assert settings["clearance"]["default"] == 0.00025 and settings["clearance"]["unit"] == "m"
    assert all(each["about"] for each in row["settings"])
    assert run(["plugins", "world:peg_in_hole"]) == 0
    assert "--set world.clearance=0.00025" in capsys.readouterr().out


@pytest.mark.needs_plugins
def test_a_default_is_shown_as_it_would_be_typed(capsys):
    assert run(["plugins", "dual_arm"]) == 0
    assert "--set configuration=B" in capsys.readouterr().out
    assert run(["plugins", "lmc"]) == 0
    assert "--set contact_only=false" in capsys.readouterr().out


def test_show_of_what_is_not_there_names_the_nearest(capsys):
    assert run(["plugins", "peg_in_hold"]) == 2
    assert "did you mean 'peg_in_hole'?" in capsys.readouterr().err


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_every_record_of_every_kind_is_shown_and_a_name_of_two_kinds_is_asked_for(capsys):
    for plugin in registry().plugins:
        for each in plugin.provides:
            assert run(["plugins", each]) == 0, each
    capsys.readouterr()
    assert run(["plugins", "replay"]) == 2
    said = capsys.readouterr().err
    assert all(text in said for text in ("replay: is the name of", "skill:replay", "output:replay"))


@pytest.mark.needs_plugins
def test_every_learner_that_lists_settings_says_what_they_are(capsys):
    for name in ("lmc", "search", "skill:replay", "dmp", "gmr", "seds", "dual_arm", "policy"):
        assert run(["plugins", name, "--json"]) == 0
        settings = json.loads(capsys.readouterr().out)["settings"]
        assert settings and all(each["about"] for each in settings)


SPOILED = """
from pathlib import Path
import numpy as np
from skillframe import hookimpl
from skillframe.extend import SkillType
from skillframe_testkit.suites import HoldSkill
class Chatty(HoldSkill):
    def step(self, observation):
        print("a step")
        return super().step(observation)
    def journal(self, trial):
        return {}["events"]
@hookimpl
def skillframe_skills():
    yield SkillType(
        name="chatty", summary="prints", example=lambda: {"phases": [{}]}, describe=lambda document: ["holds"],
        build=lambda document: Chatty(duration=VALUE),
    )
"""
ODD = """
from dataclasses import dataclass, replace
from skillframe import hookimpl
from skillframe.extend import WorldType
from skillframe.world.scene import Geom
from skillframe_worlds import valley
@hookimpl
def skillframe_worlds():
    def build(params):
        return replace(valley.build(params), name="odd", fixture=(Geom(kind="torus", size=(0.1, 0.02)),))
    yield WorldType(name="odd", summary="a ring", params=valley.ValleyParams, build=build)
"""


def spoiled(made, text):
    (made / "src" / "skillframe_glide_slowly" / "__init__.py").write_text(text)


@pytest.mark.slow
def test_check_s_json_stays_json_when_a_skill_prints(made, capsys):
    spoiled(made, SPOILED.replace("VALUE", "5.0"))
    capsys.readouterr()
    assert run(["plugins", "check", "glide_slowly", "--json"]) == 1
    problems = json.loads(capsys.readouterr().out)[1]["problems"]
    assert any("prints 'a step'" in problem for problem in problems)
    assert any("journal(0) raised KeyError: 'events'" in problem for problem in problems)


def test_check_names_a_kind_of_geom_that_is_none_and_says_which_there_are(made, capsys):
    spoiled(made, ODD)
    assert run(["plugins", "check", "glide_slowly"]) == 1
    said = capsys.readouterr()
    assert "unknown kind 'torus'" in said.out
    assert "internal error" not in said.err


@pytest.mark.slow
def test_check_warns_of_a_skill_that_never_ends_and_exits_0(made, capsys):
    quiet = SPOILED.replace("VALUE", "None").replace('print("a step")', "pass").replace('{}["events"]', "[]")
    spoiled(made, quiet)
    assert run(["plugins", "check", "glide_slowly"]) == 0
    assert "    - warning: is still under way after 120 s; give it a time limit" in capsys.readouterr().out


def test_show_says_the_unit_of_a_score_the_folder_of_a_robot_and_what_a_format_was_checked_against(capsys):
    assert run(["plugins", "robot:panda"]) == 0
    assert "  folder: " in capsys.readouterr().out
    assert run(["plugins", "crisp", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)["facts"]
    assert facts["checked against"].startswith("utiasDSL/crisp_controllers") and facts["axes"] == "base"
