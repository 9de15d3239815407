"""Draws docs/images/crane_control.svg: python -m tests.figures.crane_picture FILE."""

import sys

import matplotlib as mpl
import numpy as np
from skillframe_hydraulics.law.hydraulic import HydraulicGains

from tests.figures.crane_contact import pressed
from tests.figures.crane_motion import DT, Truth, run
from tests.figures.crane_rivals import TUNED, Rivals, Vdc
from tests.laws.vdc_motion import diamond

TRUTH, SHARE, SECONDS = Truth(1.2, 0.9), 0.9, 40.0


def path(t):
    return diamond(t, 5.0)


def error_of(controller):
    errors, _, _ = run(controller, path, SECONDS, [TRUTH], [1], bonds=np.inf)
    return np.hypot(*errors[::20, 0].T) * 1e3


def draw(where):
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    mpl.rcParams["svg.hashsalt"] = "crane"
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.0), layout="constrained")
    never = HydraulicGains(adaptation=0.0, friction=(0.0, 0.0))
    controllers = {
        "VDC": Vdc(path, SHARE, 1), "VDC without adaptation": Vdc(path, SHARE, 1, never),
        "computed torque, tuned": Rivals(path, SHARE, [TUNED["model"]]),
        "PI on the valve, tuned": Rivals(path, SHARE, [TUNED["valve"]]),
    }  # fmt: skip
    time = np.arange(0.0, SECONDS, 20 * DT)
    for (name, controller), width in zip(controllers.items(), (2.0, 1.0, 1.0, 1.0), strict=True):
        left.plot(time, error_of(controller), label=name, linewidth=width)
    left.set(xlabel="time [s], two laps", ylabel="error of the tool [mm]", ylim=(0.0, 30.0), title="published path")
    left.legend(fontsize="small")
    for damping in (5e4, 2.5e3):
        found = pressed(1e6, damping=damping)
        label = f"D = {damping / 1e3:g} kN s/m"
        right.plot(found.time[::10], found.force[::10, 1] / 1e3, label=label, linewidth=1.0, zorder=damping)
    right.set(xlabel="time [s]", ylabel="normal force [kN]", title="contact on 1e6 N/m, then sliding")
    right.legend(fontsize="small")
    figure.savefig(where, metadata={"Date": None})


if __name__ == "__main__":
    draw(sys.argv[1])
