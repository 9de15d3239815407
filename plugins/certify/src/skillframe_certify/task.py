"""`TASK.toml`: everything that leads to a certificate, in one file.

    world = "valley"
    robot = "panda"
    teacher = 2                  # demonstrations by the simulated teacher, or
    # demonstrations = ["one.npz", "two.npz"]
    seed = 1
    rate = 0.95
    [vary]
    "fixture.offset_x" = { uniform = ["-15mm", "15mm"] }

The learner's keys are `learner`, `at` and `[learn]` (`Keys`). The others are those of a campaign file
(`spec`): `name`, `coc`, `duration_s`, `[set]`.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skillframe.campaign import DURATION_S, to_lines
from skillframe.config import build, read_toml
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import refuse_other
from skillframe_certify.question import USUAL

TASK, CAMPAIGN, DEMONSTRATIONS, SKILL = "task.toml", "campaign.toml", "demonstrations", "skill.skill.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """The keys of a task file, in TOML types.

    Attributes:
        teacher: demonstrations that the simulated teacher records; 0 if files are given.
        demonstrations: files, relative to the task's.
        learner: kind of skill that is learned, `at` its frame or point, `learn` its settings.
        duration_s: simulated time after which a trial has failed [s].
        rate, confidence: of the claim.
    """

    world: str
    robot: str = "panda"
    name: str = ""
    seed: int = 1
    teacher: int = 0
    demonstrations: tuple[str, ...] = ()
    learner: str = "lmc"
    at: str | None = None
    learn: dict[str, Any] = field(default_factory=dict)
    coc: str | None = None
    duration_s: float = DURATION_S
    rate: float = USUAL
    confidence: float = USUAL
    vary: dict[str, Any] = field(default_factory=dict)
    set: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskFile(Keys):
    """A task.

    Attributes:
        path: its file; relative paths start in its folder.
        given: its content as read.
    """

    path: Path
    given: dict[str, Any]

    @classmethod
    def from_toml(cls, path: Path) -> TaskFile:
        """Read a task from its file.

        Raises:
            InputError: what is wrong and where.
        """
        refuse_other(path, "task")
        table = read_toml(path)
        file = build(Keys, table, f"{path}: task")
        if bool(file.teacher > 0) == bool(file.demonstrations):
            raise InputError(
                f"{path}: teacher", "has to be a number of demonstrations, or demonstrations a list of files",
                "give one of the two",
            )  # fmt: skip
        for i, name in enumerate(file.demonstrations):
            if not (path.parent / name).is_file():
                raise InputError(f"{path}: demonstrations[{i}]", f"no such file: {name}", "paths are relative to TASK")
        if not file.vary:
            raise InputError(f"{path}: vary", "is empty", "declare one to four ranges, of which the box is made")
        values = {name: getattr(file, name) for name in Keys.__dataclass_fields__}
        return cls(**(values | {"name": file.name or path.name.partition(".")[0]}), path=path, given=dict(table))

    @property
    def world_from_here(self) -> str:
        """The world as a command takes it: a name, or the path of its file from here."""
        return str(self._beside(self.world) or self.world)

    @property
    def robot_from_here(self) -> str:
        """The robot as a command takes it."""
        return str(self._beside(self.robot) or self.robot)

    def _beside(self, name: str) -> Path | None:
        """The path that a name stands for, or None if it is not a path."""
        beside = self.path.parent / name
        return beside if name.endswith(".toml") or ("/" in name and beside.exists()) else None

    def demonstrations_in(self, out: Path) -> list[Path]:
        """Return the paths of the demonstrations in a folder."""
        if self.teacher == 1:
            return [out / DEMONSTRATIONS / "demo.npz"]
        named = [f"demo{i}.npz" for i in range(1, self.teacher + 1)] or [Path(n).name for n in self.demonstrations]
        return [out / DEMONSTRATIONS / name for name in named]

    def settle(self, out: Path) -> None:
        """Create the task's folder, or check that it belongs to this task.

        Raises:
            InputError: the folder belongs to another task or holds something else.
        """
        if (out / TASK).is_file():
            if read_toml(out / TASK) != self.given:
                raise InputError(out, "belongs to another task, or this one was changed", "choose another --out")
        elif out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(out, "exists and is not an empty folder", "choose another --out")
        (out / DEMONSTRATIONS).mkdir(parents=True, exist_ok=True)
        for name, place in zip(self.demonstrations, self.demonstrations_in(out), strict=False):
            source = self.path.parent / name
            for part in (source, source.with_name(source.stem + ".meta.toml")):
                if part.is_file():
                    shutil.copyfile(part, place.with_name(part.name))
        write_whole(out / CAMPAIGN, self.campaign(out).encode())
        write_whole(out / TASK, self.path.read_bytes())

    def campaign(self, out: Path) -> str:
        """Return the text of a folder's campaign file."""
        paths = {"robot": self._beside(self.robot), "world": self._beside(self.world)}
        here = {key: str(path.absolute()) if path else getattr(self, key) for key, path in paths.items()}
        top = {
            "name": self.name, "seed": self.seed, "trials": 1, **here, "skills": (SKILL,), "coc": self.coc,
            "duration_s": self.duration_s,
        }  # fmt: skip
        return "\n".join([to_lines(top), f"[vary]\n{to_lines(self.vary)}", f"[set]\n{to_lines(self.set)}"])

    def bring_demonstrations(self, out: Path) -> None:
        """Copy the demonstrations beside the fresh trials, where a report expects them."""
        for fresh in sorted((out / "proof").glob("claim*/fresh")):
            (fresh / DEMONSTRATIONS).mkdir(exist_ok=True)
            for path in self.demonstrations_in(out):
                if path.is_file():
                    shutil.copyfile(path, fresh / DEMONSTRATIONS / path.name)
