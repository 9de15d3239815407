"""From two meshes to a tried skill without a demonstration.

1. world: the way out is the first free direction of the meshes (`fixture.toml` beside copies of them).
2. removal: the part is pulled out of its assembled pose. The record gives place, way and orientation.
3. skill: a straight push and a search over the stated error (`learn --skill seat --set removal=true`).
4. practice: a campaign over the stated error.

Files in the folder are kept, so that an interrupted practice goes on.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from skillframe_parts.found import needs_units, new_text
from skillframe_parts.load import LoadedParts, load

from skillframe import Campaign, CampaignResults, LearnedSkill, learn, record
from skillframe.api import demonstrations_of, scene_of
from skillframe.campaign import Options, Progress, evaluate, run_campaign
from skillframe.demonstration import Demonstration
from skillframe.errors import InputError, SkillframeWarning
from skillframe.files import write_whole

FIXTURE, REMOVAL, SKILL, TRIALS = "fixture.toml", "removal.npz", "seat.skill.json", "trials"
PLAN, CERTIFY = "campaign.toml", "certify.toml"
YAW = "fixture.tilt_z"
"""Left out where a box is certified, which has at most four ranges."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Practice:
    """What is practised, in which folder.

    Attributes:
        files: names and beginnings of the hashes of fixture file and meshes.
        robot: name of a shipped robot, or a robot.toml.
        shift, tilt: largest error of the socket's place [m] and orientation [rad], about each axis.
        trials: of the campaign.
        seed: of everything random.
    """

    files: str
    robot: str = "panda"
    shift: float = 0.002
    tilt: float = math.radians(5.0)
    trials: int = 20
    seed: int = 0

    @property
    def most(self) -> dict[str, float]:
        """Largest errors of the socket by quantity [m, rad]."""
        return {f"fixture.offset_{a}": self.shift for a in "xy"} | {f"fixture.tilt_{a}": self.tilt for a in "xyz"}


def world_of(plug: Path, socket: Path, units: str | None, folder: Path, say: Callable[[str], None]) -> LoadedParts:
    """The parts of the folder's fixture file, which is written beside copies of both meshes where it is missing.

    Raises:
        InputError: the parts overlap, do not come apart, a mesh cannot be used, or the file names other meshes.
    """
    fixture = folder / FIXTURE
    if not fixture.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for mesh in (plug, socket):
            write_whole(folder / mesh.name, mesh.read_bytes())
        unit = units if needs_units(plug.name, socket.name) else None
        write_whole(fixture, new_text(FIXTURE, plug.name, socket.name, unit, '"auto"').encode())
        try:
            return load(fixture, say)
        except BaseException:
            fixture.unlink()  # no file for refused parts
            raise
    parts = load(fixture, say)
    for mesh in (plug, socket):
        if hashlib.sha256(mesh.read_bytes()).hexdigest() not in parts.hashes.values():
            raise InputError(mesh, f"is not a mesh of {fixture}", "choose another --out")
    return parts


def files_of(parts: LoadedParts) -> str:
    """`Practice.files` of some parts."""
    return ", ".join(f"{name} {value[:12]}" for name, value in parts.hashes.items())


def removed(folder: Path, practice: Practice) -> Demonstration:
    """The record of taking the part out.

    Raises:
        SkillframeError: it does not come out.
    """
    path = folder / REMOVAL
    if not path.exists():
        record(folder / FIXTURE, practice.robot, teacher="disassembly", seed=practice.seed).save(path)
    return demonstrations_of(path)[0]


def learned(folder: Path, practice: Practice, taken: Demonstration) -> LearnedSkill:
    """The skill of the removal, with a search over the stated error.

    Raises:
        InputError: the part did not come straight out.
    """
    path = folder / SKILL
    if not path.exists():
        stopped = scene_of(str(folder / FIXTURE), None, depth=1)[0].task.stop is None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkillframeWarning)  # it begins in contact, as it has to
            made = learn(taken, "seat", removal=True, stopped=stopped, shift=practice.shift, tilt=practice.tilt)
        made.save(path)
    return LearnedSkill.load(path)


CAMPAIGN = """\
name = {name}
seed = {seed}
trials = {trials}
robot = {robot}
world = "{world}"
coc = "tip"
skills = ["{skill}"]
duration_s = {seconds:g}
[vary]
"""


def tried(folder: Path, practice: Practice, notify: Callable[[Progress], None]) -> CampaignResults:
    """A campaign over the stated error, and the file of one to certify. It goes on where it was ended."""
    out = folder / TRIALS
    if not (folder / CERTIFY).exists():
        error = f"within {1e3 * practice.shift:g} mm and {math.degrees(practice.tilt):g} degrees"
        text = CAMPAIGN.format(
            name=json.dumps(f"{folder.resolve().name}: {error}"), seed=practice.seed, trials=practice.trials,
            robot=json.dumps(practice.robot), world=FIXTURE, skill=SKILL, seconds=15.0,
        )  # fmt: skip
        ranges = [f'"{name}" = {{ uniform = [{-most}, {most}] }}\n' for name, most in practice.most.items() if most]
        write_whole(folder / PLAN, (text + "".join(ranges)).encode())
        write_whole(folder / CERTIFY, (text + "".join(each for each in ranges if YAW not in each)).encode())
    if not out.exists():
        Campaign(folder / PLAN).prepare(out)
    run_campaign(out, evaluate.evaluate, Options(traces=0, chunk=64), notify)
    return CampaignResults(out)
