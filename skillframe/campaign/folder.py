"""A campaign's folder: all that the campaign needs is copied in. Reports, resumes and replays need nothing else.

    campaign.toml   as run: world parameters in full, paths into this folder
    skills/ robots/ copies of what ran; worlds/ too, if the world is a fixture file
    scene.json      geometry of the scene and its analytic figures
    rows.jsonl      see `store`
    results.csv summary.json traces/

The folder is prepared beside its place and moved there when it is whole, so a kill leaves no half of one.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import secrets
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skillframe.campaign.axes import Value
from skillframe.campaign.provenance import combined_hash, file_hashes
from skillframe.campaign.spec import CampaignSpec
from skillframe.config import build, read_toml
from skillframe.document.source import parse_source
from skillframe.errors import InputError
from skillframe.files import remove_temporary, sync_folder, write_whole
from skillframe.files.documents import read_json
from skillframe.parts.declared import mesh_files
from skillframe.robot.meshes import LARGEST_FILE, mesh_names, resolve_mesh
from skillframe.robot.spec import robot_folder

CAMPAIGN, SCENE = "campaign.toml", "scene.json"
COPIES = ("skills", "robots", "worlds")
Describe = Callable[[CampaignSpec], dict[str, Any]]


def prepare(spec: CampaignSpec, out: Path, describe: Describe, params: type) -> CampaignSpec:
    """Make a campaign's folder.

    Args:
        spec: as read from the user's file.
        out: the folder; absent or empty.
        describe: the scene as plain JSON values, from the spec as it will run; raises where it cannot run.
        params: the world's parameter dataclass.

    Returns:
        the campaign as it will run, relative to the new folder.

    Raises:
        InputError: the folder holds something, a robot or skill cannot be found, or `describe` refuses.
    """
    _refuse_full(out)
    temporary = out.absolute().with_name(f".{out.absolute().name}.{secrets.token_hex(8)}")
    try:
        temporary.mkdir(parents=True)
        ready = replace(
            spec, folder=temporary, skills=_copy_skills(spec, temporary), robot=_copy_robot(spec, temporary),
            world=_copy_world(spec, temporary), fixed=_all_fixed(spec, params),
        )  # fmt: skip
        write_whole(temporary / CAMPAIGN, to_toml(ready).encode())
        write_whole(temporary / SCENE, json.dumps(describe(ready), sort_keys=True).encode())
        for folder, _, _ in os.walk(temporary):
            sync_folder(Path(folder))
        os.replace(temporary, out)
        sync_folder(out.absolute().parent)
    except InputError as error:  # the copies are of no use to whoever reads it
        where = error.where.replace(f"{temporary}/skills", str(spec.folder)).replace(f"{temporary}/", "")
        raise InputError(where, error.problem, error.fix) from None
    except OSError as error:
        named = str(error.filename2 or error.filename or temporary).replace(str(temporary), str(out))
        raise InputError(named, f"cannot be written ({error.strerror or error})", "nothing was kept") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return CampaignSpec.from_toml(out / CAMPAIGN, params)


def sweep(folder: Path) -> None:
    """Remove what killed sessions left half written. Only under the folder's lock."""
    for place in (folder, folder / "traces"):
        remove_temporary(place)


def sweep_prepared(place: Path) -> None:
    """Remove what killed sessions left of campaigns that were being prepared in a folder. Only where nobody writes."""
    remove_temporary(place)
    for path in place.glob(".*"):
        if re.fullmatch(r"\..+\.[0-9a-f]{16}", path.name) and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)


def load(folder: Path, params: type | None = None) -> CampaignSpec:
    """The campaign of a prepared folder.

    Raises:
        InputError: there is none.
    """
    if not (folder / CAMPAIGN).is_file():
        raise InputError(
            folder, "is not a campaign's folder", "start one with skillframe campaign run FILE.toml --out DIR"
        )
    return CampaignSpec.from_toml(folder / CAMPAIGN, params)


def robot_notes(folder: Path) -> list[str]:
    """Sentences on what the robot's description leaves out, as scene.json of a prepared folder holds them."""
    path = folder / SCENE
    told = read_json(path, f"start the campaign again, or remove {path}") if path.is_file() else {}
    notes = told.get("notes") if isinstance(told, dict) else None
    return [str(text) for text in notes] if isinstance(notes, list) else []


def campaign_hash(spec: CampaignSpec) -> str:
    """Hash of everything that decides the rows: the campaign as run, and the files it uses."""
    return combined_hash({"spec": spec.plain(), "files": file_hashes(spec.folder, COPIES)})


def _refuse_full(out: Path) -> None:
    if (out / CAMPAIGN).exists():
        raise InputError(
            out, "holds a campaign already", f"type skillframe campaign resume {out}, or choose another --out"
        )
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "exists and is not an empty folder", "choose another --out")


def _copy_skills(spec: CampaignSpec, target: Path) -> tuple[str, ...]:
    (target / "skills").mkdir()
    copied: dict[str, str] = {}  # name in the folder to source

    def place(file: str) -> str:
        source = spec.folder / file
        if copied.setdefault(source.name, file) != file:
            problem = f"{copied[source.name]} and {file} have the same name"
            raise InputError("campaign: skills", problem, "rename one of them")
        beside = source.with_name(source.stem + ".meta.toml")  # a CSV demonstration's metadata
        for part in (source, beside) if beside.is_file() else (source,):
            shutil.copyfile(part, target / "skills" / part.name)
        return f"skills/{source.name}"

    return tuple(parse_source(text, spec.folder).moved(place).text for text in spec.skills)


def _copy_world(spec: CampaignSpec, target: Path) -> str:
    """Copy a fixture file with its meshes. The name of any other world stays."""
    if not spec.world.endswith(".toml"):
        return spec.world
    source = Path(spec.world_place)
    place = target / "worlds" / source.resolve().parent.name
    for name, file in {source.name: source, **mesh_files(source)}.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place / name)
    return (place / source.name).relative_to(target).as_posix()


def _copy_robot(spec: CampaignSpec, target: Path) -> str:
    """Copy the robot's description, with the meshes by which collisions know its links."""
    given = spec.folder / spec.robot
    if given.is_dir() and (given / "robot.toml").is_file():
        given = given / "robot.toml"
    if given.is_file():
        return _copy_robot_file(given, target)
    found = robot_folder(spec.robot, "or give the path of a robot.toml, relative to the campaign file")
    return _copy_robot_file(found / "robot.toml", target)


def _copy_robot_file(source: Path, target: Path) -> str:
    """A robot.toml with the URDF and the FMU files it names, or a bare URDF."""
    name = source.resolve().parent.name if source.name == "robot.toml" else source.stem
    place = target / "robots" / name
    place.mkdir(parents=True)
    shutil.copyfile(source, place / source.name)
    if source.suffix == ".toml":
        given = read_toml(source)
        urdf = given.get("urdf")
        if not isinstance(urdf, str) or not (source.parent / urdf).is_file():
            raise InputError(f"{source}: urdf", f"no such file: {urdf!r}", "it is relative to robot.toml")
        _copy_beside(source, place, urdf, "urdf")
        _copy_meshes(source.parent / urdf, place / urdf, target / "robots")
        for fmu in {str(row.get("fmu")) for row in given.get("actuation", []) if isinstance(row, dict)}:
            if (source.parent / fmu).is_file():  # else a name in fmus/
                _copy_beside(source, place, fmu, "fmu")
    else:
        _copy_meshes(source, place / source.name, target / "robots")
    return (place / source.name).relative_to(target).as_posix()


def _copy_beside(source: Path, place: Path, file: str, key: str) -> None:
    """A file that robot.toml names, at the same place in the copied folder."""
    inside = place / file
    if not inside.resolve().is_relative_to(place.parent.resolve()):
        raise InputError(
            f"{source}: {key}",
            f"{file} lies outside the robot's folder and those beside it",
            "put both into one folder",
        )
    inside.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source.parent / file, inside)


def _copy_meshes(urdf: Path, copied: Path, robots: Path) -> None:
    """Meshes of a URDF that are there and can be read, where their names find them again from the copied URDF."""
    for uri in mesh_names(urdf):
        file, (scheme, separator, rest) = resolve_mesh(uri, urdf), uri.partition("://")
        if file is None or scheme == "file" or file.stat().st_size > LARGEST_FILE:
            continue
        inside = copied.parent / (rest if separator else uri)
        if not inside.resolve().is_relative_to(robots.resolve()):
            what = "lies outside the robot's folder, and a campaign's folder keeps all that it needs"
            raise InputError(f"{urdf}: mesh {uri!r}", what, "put robot.toml, URDF and meshes into one folder")
        inside.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, inside)


def _all_fixed(spec: CampaignSpec, params: type) -> dict[str, Value]:
    """The fixed quantities with every world parameter that does not vary, so that new defaults change no replay."""
    given = {name.removeprefix("world."): v for name, v in spec.fixed.items() if name.startswith("world.")}
    world: Any = build(params, given, f"world.{spec.world}")
    full = {f"world.{f.name}": getattr(world, f.name) for f in dataclasses.fields(world) if f.init}
    kept = {name: value for name, value in full.items() if name not in spec.vary and value is not None}
    return {**spec.fixed, **kept}


def to_toml(spec: CampaignSpec) -> str:
    """The campaign as TOML that `CampaignSpec.from_toml` reads back."""
    top = {
        key: getattr(spec, key) for key in ("name", "seed", "trials", "robot", "world", "skills", "coc", "duration_s")
    }
    top |= {"scores": spec.scores} if spec.scores else {}
    stop, expect = dataclasses.asdict(spec.stop), dataclasses.asdict(spec.expect)
    tables: dict[str, Mapping[str, Any]] = {
        "vary": {n: a.plain() for n, a in spec.vary.items()},
        "set": spec.fixed,
        "stop": stop,
        **({"race": dataclasses.asdict(spec.race)} if spec.race else {}),
        "expect": expect,
    }
    parts = [to_lines(top), *(f"[{name}]\n{to_lines(table)}" for name, table in tables.items() if to_lines(table))]
    return "\n".join(parts)


def to_lines(table: Mapping[str, Any]) -> str:
    """Keys and values of a table as TOML, those that are None left out."""
    return "".join(f"{_key(key)} = {_toml(value)}\n" for key, value in table.items() if value is not None)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, int | float) else _text(str(value))


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _text(name)


def _text(text: str) -> str:
    """A TOML basic string. JSON's escapes are a subset of TOML's."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
