"""A plug-in that was written for another skillframe is named in one sentence and gives nothing."""

import pytest

from skillframe import __version__
from skillframe.errors import UnknownName
from skillframe.extend.contract import CONTRACT, OLDEST, contract_problem, requirement_problem
from skillframe.extend.registry import load_registry

CODE = """
from skillframe import hookimpl
from skillframe.extend import SkillType
{top}
@hookimpl
def skillframe_skills():
    yield SkillType(name="slide", summary="a skill", build=lambda document: None{record})
    yield SkillType(name="turn", summary="a skill", build=lambda document: None)
"""
NEWER = "was written for contract 9.1, and this skillframe serves 0.1 to 0.2; update skillframe"
OLDER = "was written for contract 0.0, and this skillframe serves 0.1 to 0.2; install a newer version of the plug-in"


def plugin(registry):
    return next(p for p in registry.plugins if p.name == "one")


@pytest.mark.parametrize(("version", "said"), [("9.1", NEWER), ("0.0", OLDER)])
def test_a_plugin_of_another_contract_is_not_loaded_and_says_so_when_its_name_is_asked_for(install, version, said):
    install("one", CODE.format(top=f'skillframe_contract = "{version}"', record=""))
    registry = load_registry()
    assert plugin(registry).error == f"the plug-in {said}"
    assert plugin(registry).provides == []
    with pytest.raises(UnknownName, match=rf"dist-one 1\.0 \(the plug-in {said}\)"):
        registry.skill("slide")


def test_one_record_of_another_contract_is_left_out_and_the_others_stay(install):
    install("one", CODE.format(top="", record=', contract="9.1"'))
    registry = load_registry()
    assert plugin(registry).error == f"skill 'slide' {NEWER}"
    assert plugin(registry).provides == ["skill:turn"]


@pytest.mark.parametrize("top", ["", f'skillframe_contract = "{CONTRACT}"', f'skillframe_contract = "{OLDEST}"'])
def test_a_plugin_within_the_window_or_from_before_there_was_one_is_loaded(install, top):
    install("one", CODE.format(top=top, record=f', contract="{CONTRACT}"'))
    assert plugin(load_registry()).error is None


def test_a_later_hook_of_a_newer_plugin_is_never_called(install):
    top = 'skillframe_contract = "9.1"\n@hookimpl\ndef skillframe_dreams():\n    raise RuntimeError("called")'
    install("one", CODE.format(top=top, record=""))
    assert plugin(load_registry()).error == f"the plug-in {NEWER}"


@pytest.mark.parametrize("stated", [0.2, "0.2.1", "v0.2", "two", ("0", "2"), True])
def test_what_is_no_contract_version_is_said_with_what_to_write(stated):
    assert contract_problem("the plug-in", stated).endswith("write two numbers in quotes, '0.2'")


def test_versions_are_compared_as_numbers_not_as_text():
    assert "update skillframe" in contract_problem("it", "0.10")
    assert not contract_problem("it", "0.2")


@pytest.mark.parametrize(
    ("requires", "asked"),
    [
        (["numpy>=2", "skillframe>=9.0"], "skillframe>=9.0"),
        (["Skillframe <0.1"], "skillframe<0.1"),
        (["skillframe[ros]>=9; python_version > '3'"], "skillframe>=9"),
    ],
)
def test_a_distribution_that_asks_for_another_skillframe_says_which(requires, asked):
    text = requirement_problem(requires, __version__)
    assert text == f"it requires {asked}, and {__version__} is installed; install versions that fit"


@pytest.mark.parametrize(
    "requires",
    [
        [], ["numpy>=99"], ["skillframe"], ["skillframe>=0.1,<9"], ["skillframe-lmc>=99"], ["skillframe_lmc>=99"],
        ["skillframe>=99; python_version < '3'"], ["skillframe>=99; extra == 'next'"],
    ],
)  # fmt: skip
def test_a_distribution_that_fits_or_asks_for_others_is_left_alone(requires):
    assert requirement_problem(requires, __version__) == ""


def test_a_development_version_counts_as_the_version_that_it_becomes():
    assert requirement_problem(["skillframe>=0.2"], "0.2.0.dev3") == ""


def test_a_requirement_that_nobody_can_read_is_said():
    assert "is no requirement" in requirement_problem(["skillframe>=="], __version__)


def test_a_wheel_that_needs_a_newer_core_is_not_even_imported(install):
    metadata = "Metadata-Version: 2.1\nName: dist-one\nVersion: 1.0\nRequires-Dist: skillframe>=9.0\n"
    install("one", "raise RuntimeError('imported')", metadata=metadata)
    assert plugin(load_registry()).error.startswith("it requires skillframe>=9.0, and ")
