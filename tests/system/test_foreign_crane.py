"""The crane with another maker's FMUs in its cylinders: named in robot.toml, run by the one loop, as with our own."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skillframe.execution.executor import Setup, simulate
from skillframe.fmu.build import find_compiler, find_fmu
from skillframe.robot.model import load_model
from skillframe.robot.spec import Limits, load_robot
from tests.fmu_cache import own_cache  # noqa: F401
from tests.laws.pushing import Push, impedance
from tests.laws.runs import generators, scene
from tests.system.foreign_fmus import container

pytestmark = [pytest.mark.slow, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]
SHIPPED = load_robot("hiab_xs031").folder


def foreign(folder: Path) -> Path:
    """hiab_xs031 with containers: their parameter names, ours as nominal, and which one takes the held force."""
    container(2, find_fmu("hydraulic_cylinder"), folder, parameters=True)
    (folder / "hiab_xs031.urdf").write_text((SHIPPED / "hiab_xs031.urdf").read_text())
    names = 'inputs = { command = "u", position = "x", velocity = "v", acceleration = "a" }\n'
    names += 'outputs = { force = "F", work = "W", pressure_a = "pa", pressure_b = "pb" }\n'
    names += 'initial_force = "cylinder.initial_force"\n'
    lines = []
    for line in (SHIPPED / "robot.toml").read_text().splitlines():
        if not line.startswith("parameters ="):
            lines.append(line.replace('fmu = "hydraulic_cylinder"', 'fmu = "held.fmu"'))
            continue
        theirs = re.sub(r"(\w+) = (?=[\d.t])", r'"cylinder.\1" = ', line)
        lines += [line.replace("parameters", "nominal", 1), theirs, names]
    (folder / "robot.toml").write_text("\n".join(lines))
    return folder / "robot.toml"


def moved(robot):
    """A push of 0.5 s along x with our law. Returns the trace's poses and forces."""
    model = load_model(load_robot(robot))
    model = replace(model, spec=replace(model.spec, limits=Limits(force_n=None, torque_rate_nm_s=None)))
    setup = Setup(robot=model, scene=scene("free"), center_of_compliance=np.zeros(3))
    push = Push((1.0, 0.0, 0.0), impedance(stiffness=1e5), speed=0.05, cap=5e3, stall=False)
    return simulate(push, setup, {}, generators(1), duration_s=0.5, trace_hz=100.0)


def test_the_crane_runs_with_another_makers_fmus_as_with_its_own(tmp_path):
    pytest.importorskip("fmu_manipulation_toolbox", reason="a dependency of development")
    own, other = moved("hiab_xs031"), moved(foreign(tmp_path))
    assert list(own.failure) == list(other.failure) == [""]
    (own,), (other,) = own.traces, other.traces
    # the same equations through another master: only the times of the steps are rounded otherwise (1e-16 s), which the
    # stiff oil multiplies; measured 1e-14 m, 1e-13 of the pressures and 1e-11 of the estimated force
    np.testing.assert_allclose(other.position, own.position, atol=1e-10)
    np.testing.assert_allclose(other.command_wrench, own.command_wrench, atol=1e-4)
    for name in ("pressure_a", "pressure_b", "valve", "piston_force", "piston_force_true", "energy_pistons"):
        np.testing.assert_allclose(other.machine[name], own.machine[name], rtol=1e-8, atol=1e-8)
    assert np.ptp(own.position[:, 0]) > 0.002  # the push did move it
    assert any("held.fmu" in note for note in other.meta["notes"])
