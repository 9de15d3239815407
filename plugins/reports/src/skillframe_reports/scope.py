"""Scope of a campaign: what varied, what was constant, and what simulation cannot show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from skillframe.campaign import Axis, flatten, parse_axis
from skillframe.errors import InputError
from skillframe_reports.headline import ranges
from skillframe_reports.learned import flat
from skillframe_reports.markup import Markup, number, tag
from skillframe_reports.quantities import quantity
from skillframe_reports.results import Results
from skillframe_reports.setup_section import driven, ideal, setup_of, table_of
from skillframe_reports.sources import Chapter

MOVED = ("start", "fixture", "grasp")
AXES = "xyz"
REAL_BLIND = (
    "Anything beyond the ranges above, and other days, parts and robots than those of these trials.",
    "Whether every trial was entered, with its true outcome.",
    "Safety of people: no force was measured on a person.",
)
"""Limits of a table of real trials."""


def scope_cards(chapter: Chapter, results: Results, simulated: bool) -> Markup:
    """Return three lists: varied, not varied, not shown."""
    lists = (
        ("What was varied", varied(chapter, results)),
        ("What was not varied", standing(chapter)),
        ("What these trials do not show", list(REAL_BLIND))
        if results.real
        else ("What this simulation cannot show", [*blind_spots(chapter, results, simulated)]),
    )
    cards = [
        tag("div", tag("h3", title), tag("ul", *(tag("li", line) for line in lines)), class_="card")
        for title, lines in lists
    ]
    return tag("div", *cards, class_="grid three scope")


def _table(chapter: Chapter, key: str) -> dict[str, Any]:
    given = chapter.spec.get(key)
    try:
        return flatten(given, key) if isinstance(given, Mapping) else {}
    except InputError:
        return {}


def varied(chapter: Chapter, results: Results) -> list[str]:
    """Return each varied quantity with its declared range, else the table's."""
    declared = _table(chapter, "vary")
    lines = [f"{quantity(name).label}: {_range(name, value)}" for name, value in declared.items()]
    lines = lines or ranges(chapter, results)
    if results.real:
        return lines or ["nothing that the table names"]
    noise = "in every trial the sensors' noise, and its sampled bias"
    return [*lines, noise if not driven(setup_of(chapter)) else "in every trial the sensors' noise"]


def _range(name: str, value: Any) -> str:
    try:
        return axis_words(name, parse_axis(value, name))
    except InputError:
        return str(value)


def axis_words(name: str, axis: Axis) -> str:
    """Return how a quantity varied, in display units."""
    figures = [_figure(name, value) for value in axis.numbers]
    unit = quantity(name).unit
    span = f"{figures[0]} to {figures[-1]} {unit}".strip()
    if axis.kind == "normal":
        return f"normal, mean {figures[0]}, standard deviation {figures[1]} {unit}".strip()
    if axis.kind == "sobol":
        return f"{span}, filled evenly (sobol)"
    if axis.kind == "uniform":
        return f"{span}, uniform"
    if axis.kind == "grid":
        return f"{span}, a grid of {len(figures)}"
    if axis.kind == "values":
        return f"{len(figures)} listed values"
    return f"one of {', '.join(figures)} {unit}".strip()


def _figure(name: str, value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return number(quantity(name).factor * float(value))


def standing(chapter: Chapter) -> list[str]:
    """Return what was constant: poses, sensors, robot, world parameters."""
    if chapter.results is not None and chapter.results.real:
        return ["whatever the table does not name: these are trials of a real robot"]
    declared, fixed = _table(chapter, "vary"), _table(chapter, "set")
    moved = [line for group in MOVED if (line := _pose_line(group, declared, fixed))]
    nominal = table_of(setup_of(chapter), "nominal")
    others = [
        f"{quantity(name).label} at {_with_unit(name, value)} (nominal)"
        for name, value in nominal.items()
        if name not in {*declared, *fixed} and name.partition(".")[0] not in MOVED
    ]
    if not nominal:
        others = ["sensors and the robot's masses and friction: this folder does not say (an older version made it)"]
    held = [
        f"{quantity(name).label} at {_with_unit(name, value)} (as the campaign sets it)"
        for name, value in fixed.items() if not name.startswith("world.")
    ]  # fmt: skip
    return [*held, *moved, *others, *_world_lines(chapter, {*declared})]


def _pose_line(group: str, declared: Mapping[str, Any], fixed: Mapping[str, Any]) -> str:
    """A line such as "fixture along y, z and about x, z: at the nominal place"."""
    free = {
        kind: [axis for axis in AXES if f"{group}.{kind}_{axis}" not in {*declared, *fixed}]
        for kind in ("offset", "tilt")
    }
    parts = [f"{word} {', '.join(free[kind])}" for kind, word in (("offset", "along"), ("tilt", "about")) if free[kind]]
    return f"{group} {' and '.join(parts)}: at the nominal place" if parts else ""


def _world_lines(chapter: Chapter, declared: set[str]) -> list[str]:
    params = chapter.scene.get("params")
    given = flat(params) if isinstance(params, Mapping) else {}
    still = [(f"world.{key}", value) for key, value in sorted(given.items()) if f"world.{key}" not in declared]
    if not given:
        return ["of the world's parameters nothing is known (the folder holds no scene.json)"]
    return [f"the world's {', '.join(_named(name, value) for name, value in still)}"] if still else []


def _named(name: str, value: object) -> str:
    return f"{quantity(name).label} {_with_unit(name, value)}"


def _with_unit(name: str, value: object) -> str:
    figure = _figure(name, value)
    return f"{figure} {quantity(name).unit}".strip() if isinstance(value, int | float) else figure


def blind_spots(chapter: Chapter, results: Results, simulated: bool) -> Iterator[str]:
    """Yield what the simulation does not test."""
    yield "That it works on metal: every row is a simulation, none comes from a real robot."
    yield "Anything beyond the ranges above. The rate is the mean over them and not that of their worst point."
    if "world.friction" not in results.varied:
        yield "Other friction: every contact has one Coulomb coefficient, and it did not vary."
    else:
        yield "Friction that changes within a trial or from place to place: every contact has one Coulomb coefficient."
    yield "Parts as they are made: burrs, dirt, wear, bending and breaking. Shapes are exact and parts are rigid."
    if ideal(chapter):
        yield "Motors and their inner loops: joints exert the commanded torque at once."
    if not driven(setup_of(chapter)) and not {"robot.mass_scale", "robot.joint_friction"} & set(results.varied):
        yield "An arm whose masses or joint friction differ from the controller's model: here they agree."
    yield "Sensors that drift, warm up, saturate or fail, and cables that pull."
    if simulated:
        yield "How well people teach it: the teacher was simulated."
    yield "Safety of people: no force was measured on a person."
