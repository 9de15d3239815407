"""Plug-ins are made as distributions on disk and put on the path, so that discovery is the real one."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from skillframe.errors import UnknownName
from skillframe.extend.registry import KINDS, RECORDS, PluginConflict, load_registry
from tests.unit.demonstration.conftest import make

GOOD = """
from skillframe import hookimpl
from skillframe.extend import SkillType, WorldType

@hookimpl
def skillframe_skills():
    yield SkillType(name="{name}", summary="a skill", build=lambda document: None)
"""


def plugin(registry, name):
    return next(p for p in registry.plugins if p.name == name)


def test_a_plugin_on_the_path_is_found_with_its_distribution_and_version(install):
    install("one", GOOD.format(name="slide"))
    registry = load_registry()
    assert registry.skill("slide").summary == "a skill"
    found = registry.provider("skill", "slide")
    assert (found.name, found.distribution, found.version) == ("one", "dist-one", "1.0")
    assert found.provides == ["skill:slide"]
    assert found.error is None


HOOK = "from skillframe import hookimpl\n@hookimpl\ndef skillframe_skills():\n    "
BROKEN = {
    "fails to import": ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
    "does not parse": ("def (", "SyntaxError"),
    "leaves on import": ("raise SystemExit('bye')", "SystemExit: bye"),
    "interrupts on import": ("raise KeyboardInterrupt('now')", "KeyboardInterrupt: now"),
    "interrupts in a hook": (HOOK + "raise KeyboardInterrupt\n    yield", "KeyboardInterrupt: "),
    "raises in a hook": (
        HOOK + "raise ZeroDivisionError('oh')\n    yield",
        "ZeroDivisionError: oh",
    ),
    "yields no record": (
        HOOK + "yield 'slide'",
        "skillframe_skills yielded 'slide', not a SkillType",
    ),
    "yields a record of another kind": (
        "from skillframe.extend import ReaderType\n"
        + HOOK
        + "yield ReaderType(name='x', summary='', suffixes=('.x',), read=print)",
        "not a SkillType",
    ),
    "gives nothing": (
        HOOK + "pass",
        "gave None instead of yielding SkillType",
    ),
    "forgets a field": (
        "from skillframe.extend import SkillType\n" + HOOK + "yield SkillType(name='x')",
        "missing 2 required keyword-only arguments",
    ),
    "has a nameless record": (GOOD.format(name=""), "with the name ''"),
    "yields one name twice": (
        GOOD.format(name="slide") + "    yield SkillType(name='slide', summary='again', build=print)",
        "yielded the name slide more than once",
    ),
    "misspells a hook": (
        "from skillframe import hookimpl\n@hookimpl\ndef skillframe_skils():\n    yield 1",
        "unknown hook 'skillframe_skils'; did you mean 'skillframe_skills'?",
    ),
    "misspells a hook's prefix": (
        "from skillframe import hookimpl\n@hookimpl\ndef skilframe_skills():\n    yield 1",
        "unknown hook 'skilframe_skills'",
    ),
    "misspells a hook without the marker": (
        "def skillframe_wrlds():\n    yield 1",
        "did you mean 'skillframe_worlds'?",
    ),
    "forgets the marker": ("def skillframe_skills():\n    yield 1", "skillframe_skills lacks @hookimpl"),
    "asks for an argument that the hook does not give": (
        "from skillframe import hookimpl\n@hookimpl\ndef skillframe_skills(config):\n    yield 1",
        "PluginValidationError",
    ),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_plugin_is_named_with_its_error_and_the_rest_works(install, how):
    code, error = BROKEN[how]
    install("broken", code, version="2.3")
    install("whole", GOOD.format(name="turn"))
    registry = load_registry()
    bad = plugin(registry, "broken")
    assert (bad.distribution, bad.version) == ("dist-broken", "2.3")
    assert error in bad.error
    assert registry.skill("turn").name == "turn"
    assert plugin(registry, "core").provides == plugin(load_registry(), "core").provides


def test_ctrl_c_of_a_person_while_a_plugin_loads_is_no_error_of_the_plugin(install):
    install("slow", "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nimport time\ntime.sleep(5)")
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        load_registry()
    assert signal.getsignal(signal.SIGINT) is before


def test_asking_for_a_skill_of_a_broken_plugin_tells_what_failed(install):
    install("broken", "import no_such_module")
    with pytest.raises(UnknownName, match=r"dist-broken 1\.0 \(ModuleNotFoundError"):
        load_registry().skill("slide")


def test_the_hooks_of_a_plugin_fail_one_by_one(install):
    code = GOOD.format(name="slide") + "@hookimpl\ndef skillframe_worlds():\n    raise ValueError('no world')\n"
    install("half", code)
    registry = load_registry()
    assert registry.skill("slide")
    assert plugin(registry, "half").error == "ValueError: no world"


def test_two_errors_of_one_plugin_are_both_told(install):
    code = GOOD.format(name="slide").replace("yield", "raise KeyError(1)\n    yield")
    install("half", code + "@hookimpl\ndef skillframe_worlds():\n    raise ValueError('no world')\n")
    error = plugin(load_registry(), "half").error
    assert "KeyError" in error and "ValueError: no world" in error


def test_strict_loading_raises_instead_of_isolating(install, monkeypatch):
    install("broken", "import no_such_module")
    monkeypatch.setenv("SKILLFRAME_STRICT_PLUGINS", "1")
    with pytest.raises(ModuleNotFoundError):
        load_registry()


def test_a_name_that_two_plugins_have_is_an_error_that_names_both(install):
    install("one", GOOD.format(name="slide"))
    install(
        "two", GOOD.format(name="slide") + "    yield SkillType(name='turn', summary='own', build=print)", version="3.1"
    )
    registry = load_registry()
    with pytest.raises(PluginConflict) as caught:
        registry.skill("slide")
    for text in (str(caught.value), plugin(registry, "two").error):
        assert "dist-one 1.0" in text and "dist-two 3.1" in text
    assert plugin(registry, "one").error is None
    assert registry.skill("turn")
    assert "slide" not in registry.names("skill")


def test_a_hook_of_a_newer_core_is_allowed_where_the_plugin_says_so(install):
    code = (
        "from skillframe import hookimpl\n@hookimpl(optionalhook=True)\ndef skillframe_report_sections():\n    yield 1"
    )
    install("newer", code)
    assert plugin(load_registry(), "newer").error is None


def test_what_a_plugin_prints_while_loading_does_not_reach_stdout(install, capsys):
    install("chatty", "print('hello')" + GOOD.format(name="slide"))
    assert load_registry().skill("slide")
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "hello" in captured.err


def test_only_selected_plugins_are_loaded(install, monkeypatch):
    install("one", GOOD.format(name="slide"))
    install("two", "raise RuntimeError('must not be imported')")
    monkeypatch.setenv("SKILLFRAME_PLUGINS", " one ,")
    registry = load_registry()
    assert [p.name for p in registry.plugins] == ["core", "one"]
    assert "two" in registry.unselected


def test_an_empty_selection_loads_the_core_alone(install, monkeypatch):
    install("one", GOOD.format(name="slide"))
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "")
    registry = load_registry()
    assert [p.name for p in registry.plugins] == ["core"]
    with pytest.raises(UnknownName, match=r"SKILLFRAME_PLUGINS leaves out .*one"):
        registry.skill("slide")


def test_a_selected_plugin_that_is_not_installed_is_told(monkeypatch):
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "lcm")
    registry = load_registry()
    assert registry.not_installed == ["lcm"]
    with pytest.raises(UnknownName, match="names lcm, which is not installed"):
        registry.skill("lmc")


def test_damaged_metadata_still_gives_a_distribution_name(install):
    install("bare", GOOD.format(name="slide"), version="0.9", metadata=False)
    install("odd", GOOD.format(name="turn"), metadata="Metadata-Version: 2.1\n")
    registry = load_registry()
    assert (plugin(registry, "bare").distribution, plugin(registry, "bare").version) == ("bare", "0.9")
    assert plugin(registry, "odd").distribution == "odd"


def test_a_damaged_entry_point_file_is_reported_and_harms_nobody(install, monkeypatch):
    install("one", GOOD.format(name="slide"))
    install("damaged", "", entry_points="[skillframe]\nno equals sign here\n")
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "one,dist-damaged")
    registry = load_registry()
    assert registry.skill("slide")
    assert "install it again" in plugin(registry, "dist-damaged").error


def test_an_entry_point_to_a_missing_object_is_reported(install):
    install("one", GOOD.format(name="slide"), entry_points="[skillframe]\none = one:absent\n")
    assert "absent" in plugin(load_registry(), "one").error


def test_every_kind_has_a_hook_and_a_record_type():
    assert KINDS.keys() == RECORDS.keys()


@pytest.mark.slow
def test_a_plugin_installed_with_pip_is_found_and_leaves_when_uninstalled(tmp_path):
    source, site = tmp_path / "source", tmp_path / "site"
    (source / "src").mkdir(parents=True)
    (source / "src" / "pip_made.py").write_text(GOOD.format(name="pip_slide"))
    (source / "pyproject.toml").write_text(
        textwrap.dedent("""
        [build-system]
        requires = ["hatchling"]
        build-backend = "hatchling.build"
        [project]
        name = "pip-made"
        version = "4.5"
        [project.entry-points.skillframe]
        pip_made = "pip_made"
        [tool.hatch.build.targets.wheel]
        packages = ["src/pip_made.py"]
        """)
    )
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, source],
        check=True,
        timeout=300,
    )
    ask = "from skillframe.extend.registry import load_registry\np = load_registry().provider('skill', 'pip_slide')\n"
    ask += "print(p.distribution, p.version)"
    environment = {**os.environ, "PYTHONPATH": str(site), "SKILLFRAME_PLUGINS": "pip_made"}
    found = subprocess.run([sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["pip-made", "4.5"]
    environment["PYTHONPATH"] = str(Path(tmp_path) / "nowhere")
    gone = subprocess.run([sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=False)
    assert "UnknownName" in gone.stderr


AUDIT = """
from skillframe import hookimpl
from skillframe.extend import AuditType

@hookimpl
def skillframe_audits():
    yield AuditType(name="count", summary="how many", warnings=lambda found: [f"{each.source}: odd" for each in found])
"""


def test_what_an_audit_says_is_a_warning_of_what_learns(install, fresh_registry):
    from skillframe.api.learning import suspicions

    install("one", AUDIT)
    demonstration = make()
    assert suspicions([demonstration, demonstration]) == [": odd", ": odd"]


def test_a_drive_whose_quantities_fail_stops_no_other_robot_and_is_named(install, monkeypatch):
    from skillframe.extend import drives

    install(
        "lagging",
        """
        from skillframe import hookimpl
        from skillframe.extend import DriveType, Lazy

        @hookimpl
        def skillframe_drives():
            yield DriveType(name="lag", summary="late", make=print, quantities=Lazy("no_such_module:quantities"))
        """,
    )
    known = load_registry()
    monkeypatch.setattr(drives, "registry", lambda: known)
    assert "world.friction" in drives.quantities()
    assert "No module named 'no_such_module'" in plugin(known, "lagging").error
    with pytest.raises(UnknownName, match=r"dist-lagging 1\.0 .*no_such_module"):
        raise drives.unknown("motor.lag", drives.quantities())
