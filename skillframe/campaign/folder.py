"""A campaign's folder, which holds copies of all that reports, resumes and replays need.

  campaign.toml   as run: all world parameters, paths into this folder
  skills/ robots/ copies of what ran; worlds/ too, if the world is a fixture file
  scene.json      geometry of the scene and its analytic figures
  rows.jsonl      see `store`
  results.csv summary.json traces/

The folder is prepared under another name and renamed when complete, so that a kill leaves none half made.

A folder has one writer, by a lock file that a killed writer cannot leave behind. The file holds pid and host. Its
advisory lock (`flock`) ends with the process, so an unlocked file that names this host is stale and is taken over; one
of another host (shared file system) is refused. On Windows, without `flock`, the file's existence is the lock, and a
killed writer's file has to be deleted by hand.
"""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import re
import secrets
import shutil
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

from skillframe.campaign.provenance import combined_hash, file_hashes
from skillframe.campaign.sampling import Value
from skillframe.campaign.spec import CampaignSpec
from skillframe.config import build, read_toml
from skillframe.document.file import parse_source
from skillframe.errors import InputError
from skillframe.extend.registry import registry
from skillframe.files import remove_temporary, sync_folder, write_whole
from skillframe.files.documents import read_json
from skillframe.robot.meshes import LARGEST_FILE, mesh_names, resolve_mesh
from skillframe.robot.spec import robot_folder

#: files of a campaign's folder: its declaration, and the scene of its first trial
CAMPAIGN, SCENE = "campaign.toml", "scene.json"
COPIES = ("skills", "robots", "worlds")  #: subfolders with copies of what a campaign used
Describe = Callable[[CampaignSpec], dict[str, Any]]  #: scene of a campaign as a JSON object


def prepare(spec: CampaignSpec, out: Path, describe: Describe, params: type) -> CampaignSpec:
    """Make a campaign's folder.

    Args:
        spec: as read from the user's file.
        out: the folder; absent or empty.
        describe: returns the scene as JSON values; raises if the campaign cannot run.
        params: the world's parameter dataclass.

    Returns:
        the campaign as it will run, relative to the new folder.

    Raises:
        InputError: the folder is not empty, a robot or skill is not found, or `describe` refuses.
    """
    if (out / CAMPAIGN).exists():
        raise InputError(
            out, "holds a campaign already", f"type skillframe campaign resume {out}, or choose another --out"
        )
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "exists and is not an empty folder", "choose another --out")
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
    except InputError as error:  # name the user's files, not the temporary copies
        where = error.where.replace(f"{temporary}/skills", str(spec.folder)).replace(f"{temporary}/", "")
        raise InputError(where, error.problem, error.fix) from None
    except OSError as error:
        named = str(error.filename2 or error.filename or temporary).replace(str(temporary), str(out))
        raise InputError(named, f"cannot be written ({error.strerror or error})", "nothing was kept") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return CampaignSpec.from_toml(out / CAMPAIGN, params)


def sweep(folder: Path) -> None:
    """Remove half-written files of killed sessions. Requires the folder's lock."""
    for place in (folder, folder / "traces"):
        remove_temporary(place)


def sweep_prepared(place: Path) -> None:
    """Remove half-prepared campaigns of killed sessions. Requires that no session is preparing one."""
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
    """Sentences on what the robot's description leaves out, from scene.json."""
    path = folder / SCENE
    told = read_json(path, f"start the campaign again, or remove {path}") if path.is_file() else {}
    notes = told.get("notes") if isinstance(told, dict) else None
    return [str(text) for text in notes] if isinstance(notes, list) else []


def campaign_hash(spec: CampaignSpec) -> str:
    """Hash of everything that decides the rows: the campaign as run, and its files."""
    return combined_hash({"spec": spec.plain(), "files": file_hashes(spec.folder, COPIES)})


def _copy_skills(spec: CampaignSpec, target: Path) -> tuple[str, ...]:
    (target / "skills").mkdir()
    copied: dict[str, str] = {}  # name in the folder to source

    def place(file: str) -> str:
        source = spec.folder / file
        if copied.setdefault(source.name, file) != file:
            problem = f"{copied[source.name]} and {file} have the same name"
            raise InputError("campaign: skills", problem, "rename one of them")
        beside = source.with_name(source.stem + ".meta.toml")  # metadata of a CSV
        for part in (source, beside) if beside.is_file() else (source,):
            shutil.copyfile(part, target / "skills" / part.name)
        return f"skills/{source.name}"

    return tuple(parse_source(text, spec.folder).moved(place).text for text in spec.skills)


def _copy_world(spec: CampaignSpec, target: Path) -> str:
    if not spec.world.endswith(".toml"):
        return spec.world
    source = Path(spec.world_place)
    place = target / "worlds" / source.resolve().parent.name
    for name, file in {source.name: source, **registry().world_file().files(source)}.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place / name)
    return (place / source.name).relative_to(target).as_posix()


def _copy_robot(spec: CampaignSpec, target: Path) -> str:
    given = spec.folder / spec.robot
    if given.is_dir() and (given / "robot.toml").is_file():
        given = given / "robot.toml"
    if given.is_file():
        return _copy_robot_file(given, target)
    found = robot_folder(spec.robot, "or give the path of a robot.toml, relative to the campaign file")
    return _copy_robot_file(found / "robot.toml", target)


def _copy_robot_file(source: Path, target: Path) -> str:
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
            if (source.parent / fmu).is_file():  # otherwise a name in fmus/
                _copy_beside(source, place, fmu, "fmu")
        if isinstance(file := given.get("parameter_set"), str) and (source.parent / file).is_file():
            _copy_beside(source, place, file, "parameter_set")
    else:
        _copy_meshes(source, place / source.name, target / "robots")
    return (place / source.name).relative_to(target).as_posix()


def _copy_beside(source: Path, place: Path, file: str, key: str) -> None:
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
    """The fixed quantities with all other world parameters, so that new defaults change no replay."""
    given = {name.removeprefix("world."): v for name, v in spec.fixed.items() if name.startswith("world.")}
    world: Any = build(params, given, f"world.{spec.world}")
    full = {f"world.{f.name}": getattr(world, f.name) for f in dataclasses.fields(world) if f.init}
    kept = {name: value for name, value in full.items() if name not in spec.vary and value is not None}
    return {**spec.fixed, **kept}


def to_toml(spec: CampaignSpec) -> str:
    """The campaign as TOML that `CampaignSpec.from_toml` reads."""
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
    """A table as TOML, without values that are None."""
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


try:
    import fcntl
except ModuleNotFoundError:  # Windows
    ADVISORY = False
else:
    ADVISORY = True

NAME = "lock"


class FolderLock:
    """Context manager that holds a campaign folder's lock.

    Raises:
        InputError: on entry, if another process holds it or one on another host may.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._descriptor = -1

    def __enter__(self) -> FolderLock:
        self._descriptor = self._acquire()
        os.ftruncate(self._descriptor, 0)
        os.lseek(self._descriptor, 0, os.SEEK_SET)
        os.write(self._descriptor, json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if not ADVISORY:  # Windows removes no open file
            os.close(self._descriptor)
        with suppress(FileNotFoundError):
            self._path.unlink()
        if ADVISORY:
            os.close(self._descriptor)

    def _acquire(self) -> int:
        if not ADVISORY:
            try:
                return os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            except FileExistsError:
                pid, host = holder(self._path.parent) or (0, "")
                raise _may_be_writing(self._path, pid, host) from None
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)  # Windows has no such flag
        while True:
            try:
                descriptor = os.open(self._path, flags, 0o644)
            except OSError as error:
                if error.errno == errno.ELOOP:
                    raise InputError(self._path, "is a link, and no lock of a campaign", "delete it") from None
                raise
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                pid, host = _owner(descriptor)
                if host not in ("", socket.gethostname()):
                    raise _may_be_writing(self._path, pid, host)
            except BlockingIOError:
                pid, host = _owner(descriptor)
                os.close(descriptor)
                fix = "wait until it ends, or stop it"
                raise InputError(self._path, f"process {pid} on {host} is writing into this folder", fix) from None
            except BaseException:
                os.close(descriptor)
                raise
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(descriptor), self._path.stat()):
                    return descriptor
            os.close(descriptor)  # its owner removed it before it was locked here


def _may_be_writing(path: Path, pid: int, host: str) -> InputError:
    fix = f"make sure that it has ended there, then delete {path}"
    return InputError(path, f"process {pid} on {host} may be writing into this folder", fix)


def _owner(descriptor: int) -> tuple[int, str]:
    """Pid and host in a lock file. 0 and "" if it is empty or damaged."""
    try:
        os.lseek(descriptor, 0, os.SEEK_SET)
        content = json.loads(os.read(descriptor, 4096))
        return int(content["pid"]), str(content["host"])
    except (ValueError, KeyError, TypeError):
        return 0, ""


def holder(folder: Path) -> tuple[int, str] | None:
    """Pid and host of the process that writes a campaign, or None. On Windows it may have been killed."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        if not ADVISORY:
            return _owner(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except BlockingIOError:
        return _owner(descriptor)
    finally:
        os.close(descriptor)


SUMMARY = "summary.json"  #: file of a campaign's summary
