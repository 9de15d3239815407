"""The page of file formats lists every key of robot.toml and every column of results.csv."""

import dataclasses
import re
import typing
from pathlib import Path

from skillframe.campaign.rows import columns
from skillframe.campaign.spec import CampaignSpec, RaceKeys
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


def test_every_key_of_robot_toml_is_on_the_page_and_no_other():
    assert sorted(first_cells("Robot")) == sorted(field.name for field in dataclasses.fields(RobotFile))


def test_every_table_of_robot_toml_is_on_the_page_in_detail():
    found = {f"{each.__module__}.{each.__name__}" for each in records(RobotFile)} - {"skillframe.robot.spec.RobotFile"}
    assert not found - set(re.findall(r"autoclass:: ([\w.]+)", PAGE))


def test_every_column_of_results_is_on_the_page_in_its_order():
    spec = CampaignSpec(
        name="n", seed=1, trials=1, robot="r", world="w", skills=("a.json", "b.json"), scores=("NAME",), race=RaceKeys()
    )
    assert first_cells("results.csv") == columns(spec, [{"second.NAME": 0.0}])
