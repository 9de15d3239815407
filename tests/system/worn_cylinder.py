"""Our cylinder as another maker's FMU that fails in two trials: in one it crashes, in one it hangs.

The sources are ours with a few lines before a step; the file lies beside robot.toml, so that it is foreign and runs in
child processes. What it looks at is the static friction, which a campaign that varies friction makes every trial's own.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from skillframe_hydraulics.cylinder.bank import instance_parameters

from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.fmu.build import build_fmu, fmu_folders
from skillframe.robot.spec import load_robot
from tests.crane_corner import SKILL

CRANE = load_robot("hiab_xs031")
STEP = "Outcome model_step(Model *m, double step, Report *r)\n{\n"
MISCHIEF = """    const double worn = m->time > {since!r} ? m->value[STATIC_FRICTION] : 0.0;
    if (worn == {crash!r}) {{ volatile int *p = NULL; *p = 1; }}
    while (worn == {hang!r}) sleep(1);
"""
SINCE = 7.2  # s of the FMU's own time: the calibration in the air ends after 7 s
CAMPAIGN = """
name = "crane into the corner"
seed = 11
trials = {trials}
robot = "{robot}"
world = "pallets"
skills = ["corner.skill.json"]
duration_s = {seconds}
[vary]
"actuator.supply_pressure" = {{ uniform = [150e5, 210e5] }}
"actuator.deadband" = {{ uniform = [0.0, 0.02] }}
"actuator.delay" = {{ uniform = [0.0, 0.02] }}
"actuator.friction_scale" = {{ uniform = [0.7, 1.3] }}
[set]
"start.offset_x" = 0.2
"start.offset_z" = -0.2
"""


def campaign(folder: Path, trials: int, crash: int, hang: int, seconds: float = 40.0) -> Path:
    """campaign.toml with a crane whose lift cylinder fails in trials `crash` and `hang`, and in no other."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(SKILL, folder)
    path = folder / "corner.toml"
    path.write_text(CAMPAIGN.format(trials=trials, robot="hiab_xs031", seconds=seconds))
    friction = _static_frictions(CampaignSpec.from_toml(path))
    assert len(set(friction)) == trials
    _crane(folder / "worn_crane", friction[crash], friction[hang])
    path.write_text(CAMPAIGN.format(trials=trials, robot="worn_crane/robot.toml", seconds=seconds))
    return path


def _static_frictions(spec: CampaignSpec) -> list[float]:
    """What the lift cylinder's FMU is told in each trial."""
    trials = range(spec.trials)
    each = instance_parameters(CRANE, draws(spec, trials), [[0.0, 0.0, 0.0] for _ in trials])
    return [one["static_friction"] for one in each[::3]]


def _crane(folder: Path, crash: float, hang: float) -> None:
    source = folder / "source" / "hydraulic_cylinder"
    shutil.copytree(fmu_folders()["hydraulic_cylinder"], source)
    code = source / "cylinder.c"
    text = code.read_text()
    assert text.count(STEP) == 1
    lines = MISCHIEF.format(since=SINCE, crash=crash, hang=hang)
    code.write_text("#include <unistd.h>\n" + text.replace(STEP, STEP + lines))
    build_fmu(source, 2, out=folder / "worn_cylinder.fmu")
    shutil.copy(CRANE.folder / "hiab_xs031.urdf", folder)
    robot = (CRANE.folder / "robot.toml").read_text()
    worn = 'fmu = "worn_cylinder.fmu"\ninitial_force = "initial_force"'
    (folder / "robot.toml").write_text(robot.replace('fmu = "hydraulic_cylinder"', worn, 1))
