"""Functions for the record of the hydraulic drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from skillframe.errors import InputError, SkillframeError
from skillframe.robot import RobotModel, RobotSpec
from skillframe_hydraulics.checks.figures import require_figures
from skillframe_hydraulics.declared import fed, gains_of, noise_of, require_declared, supplies_of
from skillframe_hydraulics.law.gains import missing_gains, with_derived_gains

if TYPE_CHECKING:
    from skillframe.execution import Setup
    from skillframe.world import Draws
    from skillframe_hydraulics.drive import MachineDrive


def make(setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> MachineDrive:
    """The drive of len(rngs) machines. Raises `InputError` for another controlled point than the tool."""
    from skillframe_hydraulics.drive import MachineDrive

    if np.any(np.abs(setup.center_of_compliance) > 1e-9):
        raise InputError(
            f"robot {setup.robot.spec.name}", "a hydraulic machine steers the origin of its tool frame",
            "set the centre of compliance to 0 0 0",
        )  # fmt: skip
    return MachineDrive(setup, draws, rngs)


def check(model: RobotModel) -> None:
    """Refuse a machine that cannot run. Raises `InputError` with file, key, and fix."""
    require_declared(model.spec)
    require_figures(model)


def derived(model: RobotModel) -> tuple[RobotModel, list[str]]:
    """The machine with derived gains, and their names, or unchanged if it cannot run."""
    try:
        return with_derived_gains(model), missing_gains(model.spec)
    except SkillframeError:
        return model, []


def told(spec: RobotSpec) -> tuple[list[str], dict[str, Any]]:
    """Sensors, gains and supplies as text, and as plain values."""
    seen, gains = noise_of(spec), gains_of(spec)
    noise = f"encoders {seen.encoder:g} rad (m), pressures {seen.pressure:g} Pa"
    body = "derived in a run" if gains.body is None else f"{gains.body:.4g} N s/m (N m s/rad)"
    lines = [
        f"  sensors: noise of {noise}, behind filters of {seen.corner_hz:g} Hz",
        f"  gains: bodies {body}, rate of the required force {gains.force_corner_hz:g} Hz",
    ]
    supplies = supplies_of(spec)
    for name, one in supplies.items():
        lines.append(
            f"  supply {name}: {one.kind.replace('_', '-')} pump of {6e4 * one.flow:.4g} l/min, line of"
            f" {1e3 * one.volume:.3g} l, feeds {', '.join(fed(spec, one))}"
        )
        if one.compensation != "none":
            lines[-1] += f", through {one.compensation}-compensated valves"
        returns = [float(a.known.get("return_pressure", 0.0)) for a in spec.actuation if a.joint in fed(spec, one)]
        if one.kind == "open_centre":
            wasted = one.flow * (one.centre_drop + max(returns, default=0.0))
            lines[-1] += f"; {wasted / 1e3:.3g} kW go through its open centres while nothing moves"
    plain = {"sensors": asdict(seen), "gains": asdict(gains)}
    return lines, {**plain, "supply": {n: asdict(one) for n, one in supplies.items()}} if supplies else plain
