"""The size of the swing that identifies a machine before each run, as its pumps allow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skillframe.frames import Float
from skillframe.robot import ClosedChain
from skillframe_hydraulics.checks.figures import Unfit, areas
from skillframe_hydraulics.declared import supplies_of
from skillframe_hydraulics.force.calibration import CALIBRATION_S, swing
from skillframe_hydraulics.law.vdc_reference import ToolTask
from skillframe_hydraulics.lines import lines_of
from skillframe_hydraulics.sharing import SharingSettings

LEAST = 0.2
"""Of the swing's size: 20 mm to each side, four times what seals and encoders leave unknown."""


def swing_flow(chain: ClosedChain, task: ToolTask, z: Float) -> Float:
    """Largest flow (L,) [m3/s] that each supply gives in the swing, with the moment arms at coordinates z (n,)."""
    state, m = chain.at(z, np.zeros(len(z))), len(task.axes)
    back = np.linalg.inv(task.jacobian(state))
    rates = []
    for time in np.arange(0.0, CALIBRATION_S, 0.02):  # the fastest part is a sine of 2 s
        _, velocity, _, joint_rate = swing(float(time), m)
        rates.append(np.concatenate([velocity, np.full(len(z) - m, joint_rate)]))
    speed = np.array(rates) @ (state.arms @ back).T
    area_a, area_b = np.array([areas(each) for each in chain.robot.spec.actuation]).T
    flow = np.abs(speed) * np.where(speed > 0.0, area_a, area_b)
    largest: Float = (flow @ lines_of(chain.robot.spec).feeds.T).max(axis=0)
    return largest


def swing_part(chain: ClosedChain, task: ToolTask) -> float:
    """Size of the swing, 1 at most, for which the pumps of a machine at home give the flow, as for `FlowSharing`."""
    spec = chain.robot.spec
    if not supplies_of(spec):
        return 1.0
    lines = lines_of(spec)
    pressures = np.array([float(a.known["supply_pressure"]) for a in spec.actuation])
    most = lines.most(np.max(lines.feeds * pressures, axis=1))
    asked = swing_flow(chain, task, chain.minimal(chain.home))
    return float(np.min(SharingSettings().share * most / np.maximum(asked, 1e-12), initial=1.0))


def unfit_pumps(chain: ClosedChain, task: ToolTask) -> Iterator[Unfit]:
    """A sentence if the pumps are too small for a swing of `LEAST` of its size."""
    if (part := swing_part(chain, task)) < LEAST:
        text = f"its pump gives {100 * part:.3g} % of the flow of the swing that identifies it before each run"
        yield Unfit(f"{text}, and {100 * LEAST:.2g} % are needed", "give the pump a larger flow or power")
