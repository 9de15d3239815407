"""The page of file formats lists every key of robot.toml and every column of results.csv."""

import dataclasses
import re
import typing
from pathlib import Path

import pytest

from skillframe.campaign.rows import columns
from skillframe.campaign.spec import CampaignSpec, RaceKeys
from skillframe.extend.registry import registry
from skillframe.robot.spec import RobotFile

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "files.md").read_text(encoding="utf-8")


def first_cells(heading):
    """Names in the first column of the tables under a heading, up to the next one."""
    section = re.split(r"^#+ ", PAGE.partition(f"# {heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
    cells = re.findall(r"^\| (`[^|]+) \|", section, re.MULTILINE)
    return [name.strip("[]") for cell in cells for name in re.findall(r"`([^`]+)`", cell)]


def records(hint):
    """The dataclasses within a type, and those within their fields."""
    for inner in typing.get_args(hint):
        yield from records(inner)
    if dataclasses.is_dataclass(hint):
        yield hint
        for each in typing.get_type_hints(hint).values():
            yield from records(each)


def of_drives():
    """The dataclass of each table of robot.toml that the drive of a plug-in reads, by its name."""
    tables = [record.tables() for record in registry().records("drive") if record.tables is not None]
    return {name: kind for table in tables for name, kind in table.items()}


@pytest.mark.needs_plugins
def test_every_key_of_robot_toml_is_on_the_page_and_no_other():
    own = [field.name for field in dataclasses.fields(RobotFile)]
    assert sorted(first_cells("Robot")) == sorted([*own, *of_drives()])


def test_every_table_of_robot_toml_is_on_the_page_in_detail():
    kinds = [RobotFile, *of_drives().values()]
    found = {f"{each.__module__}.{each.__name__}" for kind in kinds for each in records(kind)}
    found -= {"skillframe.robot.spec.RobotFile"}
    assert not found - set(re.findall(r"autoclass:: ([\w.]+)", PAGE))


def test_every_column_of_results_is_on_the_page_in_its_order():
    spec = CampaignSpec(
        name="n", seed=1, trials=1, robot="r", world="w", skills=("a.json", "b.json"), scores=("NAME",), race=RaceKeys()
    )
    assert first_cells("results.csv") == columns(spec, [{"second.NAME": 0.0}])
