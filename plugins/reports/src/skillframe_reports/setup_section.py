"""Set-up of a campaign: teacher, robot, interface, controller and sensors, as far as files state them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from skillframe.campaign import name_of
from skillframe_reports.markup import number
from skillframe_reports.quantities import quantity
from skillframe_reports.sources import Chapter

UNKNOWN = "not known: the folder does not say"
IDEAL = "ideal torque source: joints exert the commanded torque at once"
FREE = "ideal force source: the tool flies freely under the commanded wrench"


def table_of(values: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a nested table, empty if absent or of another type."""
    found = values.get(key)
    return found if isinstance(found, Mapping) else {}


def setup_of(chapter: Chapter) -> Mapping[str, Any]:
    """Return `setup` of scene.json, else what robot.toml states."""
    noted = table_of(chapter.scene, "setup")
    if noted or not chapter.robot:
        return noted
    kind = table_of(chapter.robot, "drive").get("kind") or "of its [[actuation]]"
    told: dict[str, Any] = {key: chapter.robot[key] for key in ("control", "limits", "base") if key in chapter.robot}
    return {**told, "drive": kind if chapter.robot.get("actuation") else ""}


def driven(setup: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a plug-in drive's `by`, `law` and `sensors` in words, empty for the core's."""
    drive = setup.get("drive") or ""
    unsaid = {"by": f"the drive {drive}", "law": "the controller of its drive", "sensors": "the sensors of its drive"}
    return {} if drive in ("", "servo") else table_of(setup, "driven") or unsaid


def ideal(chapter: Chapter) -> bool:
    """Return whether torques act on the joints directly, as far as known."""
    setup = setup_of(chapter)
    return bool(setup) and not setup.get("drive") and _interface_name(setup) in ("", "torque")


def _interface_name(setup: Mapping[str, Any]) -> str:
    return str(table_of(setup, "control").get("interface") or "")


def facts(chapter: Chapter, skill: str) -> list[tuple[str, str]]:
    """Return label and text of each fact about a skill."""
    return [
        ("Taught by", taught_by(chapter, skill)[0]), ("Robot", robot_words(chapter)),
        ("Interface", interface_words(setup_of(chapter))), ("Controller", controller_words(chapter, skill)),
        ("Sensors", sensor_words(chapter)),
    ]  # fmt: skip


def taught_by(chapter: Chapter, skill: str) -> tuple[str, bool]:
    """Return who taught a skill, and whether a simulated teacher took part."""
    metas = _teachers(chapter, skill)
    if metas is None:
        return "not known: the folder does not hold the skill", False
    if not metas:
        return "nobody: the skill file names no demonstration", False
    counts = Counter[str]()
    for meta in metas:
        how = f" ({kind})" if meta is not None and (kind := meta.get("teacher")) else ""
        if meta is None:
            counts["whose teacher is not known (the folder does not hold the recording)"] += 1
        else:
            counts[f"by a simulated teacher{how}" if meta.get("simulated") else f"from a recording{how}"] += 1
    said = [f"{_count(n)} {who}" for who, n in counts.items()]
    return " and ".join(said), any(meta is not None and bool(meta.get("simulated")) for meta in metas)


def _teachers(chapter: Chapter, skill: str) -> list[Mapping[str, Any] | None] | None:
    """Metadata of a skill's demonstrations, None for missing ones, or None without the skill."""
    document = chapter.skills.get(skill)
    if document is not None:
        given = document.get("learned_from")
        sources = given if isinstance(given, list) else []
        return [
            (source if "simulated" in source else chapter.taught.get(str(source.get("sha256"))))
            if isinstance(source, Mapping)
            else None
            for source in sources
        ]
    kind, colon, files = skill.partition(":")
    if not colon or not kind:
        return None
    names = [name.rsplit("/", 1)[-1] for name in files.split(",") if "=" not in name]
    return [chapter.taught.get(name) for name in names]


def _count(n: int) -> str:
    return "one demonstration" if n == 1 else f"{n} demonstrations"


def robot_words(chapter: Chapter) -> str:
    """Return name and summary of the robot."""
    name = name_of(str(chapter.spec.get("robot") or chapter.summary.get("robot") or ""))
    summary = str(chapter.robot.get("summary") or "")
    return ": ".join(part for part in (name, summary) if part) or UNKNOWN


def interface_words(setup: Mapping[str, Any]) -> str:
    """Return what receives the controller's commands."""
    if not setup:
        return UNKNOWN
    name = _interface_name(setup)
    if setup.get("drive"):
        return f"{driven(setup).get('by', 'electric servos')}, simulated"
    if name in ("", "torque"):
        return FREE if setup.get("base") == "free" else IDEAL
    rest = {k: v for k, v in table_of(setup, "control").items() if k not in ("interface", "rate_hz")}
    return ", ".join([f"{name} interface", *(f"{key.replace('_', ' ')} {value}" for key, value in rest.items())])


def controller_words(chapter: Chapter, skill: str) -> str:
    """Return the controller, its rate, and the kind of skill."""
    rate = table_of(setup_of(chapter), "control").get("rate_hz")
    law = driven(setup_of(chapter)).get("law") or "impedance of the tool"
    at = f" at {number(float(rate), 4)} Hz" if isinstance(rate, int | float) else ""
    document = chapter.skills.get(skill)
    kind = str((document or {}).get("type") or skill.partition(":")[0])
    made = table_of(document or {}, "created_by")
    by = f" of {made['plugin']} {made.get('plugin_version', '')}".rstrip() if made.get("plugin") else ""
    return f"{law}{at}; a skill of type {kind}{by}"


def sensor_words(chapter: Chapter) -> str:
    """Return the sensors with their noise, as recorded by the campaign."""
    told = table_of(setup_of(chapter), "sensors")
    if not told:
        return "noise not written down in this folder"
    where = driven(setup_of(chapter)).get("sensors")
    if not where:
        known = setup_of(chapter).get("encoders")
        joints = {None: "encoders", "": "exact joint positions"}.get(known, f"encoders ({known})")
        where = f"{joints} and a force-torque sensor at the wrist"
    return f"{where}; standard deviations: {', '.join(_deviation(key, value) for key, value in told.items())}"


def _deviation(key: str, value: object) -> str:
    words = key.replace("_", " ")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f"{words} {value}"
    named = quantity(key)
    return f"{words} {number(named.factor * float(value))} {named.unit}".strip()
