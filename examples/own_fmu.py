"""Your own FMU, co-simulated without a robot.

A winch, some lines of C beside this script, becomes an FMU and lifts a mass. The master couples any mechanics, here a
class of six short methods, with any actuators. The winch's force falls with its speed, so that the exact solution is
known: the speed settles as 1 - exp(-t d / m). The error halves with the step, as the winch asks for the speed alone.
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from skillframe.cosim import CosimSettings, Master, Motion, coupling_numbers, require_stable
from skillframe.fmu import ActuatorSpec, build_fmu, open_actuators

STALL, DRAG, MASS, GRAVITY, COMMAND = 2000.0, 500.0, 120.0, 9.81, 0.8
WINCH = Path(__file__).parent / "winch"  # fmu.toml declares the variables, winch.c computes the force


class Load:
    """A mass on a rope, under a force that goes linearly from begin to end of a step; one entry per bond."""

    count = 1
    position = velocity = np.zeros(1)

    def motion(self, force: np.ndarray) -> Motion:
        return Motion(self.position, self.velocity, force / MASS - GRAVITY)

    def advance(self, begin: np.ndarray, end: np.ndarray, step: float) -> None:
        self.position = self.position + step * self.velocity + step**2 * ((2 * begin + end) / MASS / 6 - GRAVITY / 2)
        self.velocity = self.velocity + step * ((begin + end) / MASS / 2 - GRAVITY)

    def effective_mass(self) -> np.ndarray:
        return np.array([MASS])

    def save(self) -> None:
        self._kept = self.position, self.velocity

    def restore(self) -> None:
        self.position, self.velocity = self._kept


def lift(fmu: Path, step: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and speed [m/s] of the load, co-simulated."""
    bank, load = open_actuators([ActuatorSpec(fmu=str(fmu), name="winch")]), Load()
    master = Master(load, bank, CosimSettings(step=step))
    master.start(command=COMMAND)
    require_stable(coupling_numbers(bank, load.effective_mass(), step), step, ["winch"], print)
    speed = [0.0]
    while len(speed) * step <= seconds and master.step(COMMAND):
        speed.append(float(load.velocity[0]))
    bank.close()
    return step * np.arange(len(speed)), np.array(speed)


def main(out: Path, quick: bool) -> None:
    """Build the winch, lift with several steps, and compare with the closed form."""
    fmu = build_fmu(WINCH, version=3)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.0), layout="constrained")
    final = (STALL * COMMAND - MASS * GRAVITY) / DRAG
    for step in (0.02, 0.01) if quick else (0.02, 0.01, 0.005):
        time, speed = lift(fmu, step, 1.5)
        error = 1e3 * (speed - final * (1.0 - np.exp(-DRAG / MASS * time)))
        print(f"step {1e3 * step:.0f} ms: largest error {np.abs(error).max():.2f} mm/s of {1e3 * final:.0f} mm/s")
        right.plot(time, error, label=f"step {1e3 * step:.0f} ms")
    left.plot(time, speed, color="#1f77b4")
    left.set(xlabel="time [s]", ylabel="speed of the load [m/s]", title="a winch as an FMU lifts 120 kg")
    right.set(xlabel="time [s]", ylabel="[mm/s]", title="difference to the closed form")
    right.legend(frameon=False)
    figure.savefig(out / "own_fmu.png", dpi=110)


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the picture")
    parser.add_argument("--quick", action="store_true", help="two step sizes")
    main(**vars(parser.parse_args()))
