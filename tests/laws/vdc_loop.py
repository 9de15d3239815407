"""The crane under Virtual Decomposition Control with ideal force actuators, in continuous time, for the laws' tests."""

from functools import cache

import numpy as np
from skillframe_hydraulics.law.vdc_adaptation import relative_bounds
from skillframe_hydraulics.law.vdc_reference import ToolTask

from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.oracle import vdc
from tests.oracle.vdc import projected_rate
from tests.oracle.vdc_reference import Path, required_motion

START = np.array([np.pi / 4, -np.pi / 2, 0.5])
PISTON = np.array([2.5e4, 2.5e4, 1.25e4])  # a tenth of k_x/k_f of the published gains [N s/m]
CORNERS = np.array([[2.5, 1.0], [3.0, 1.5], [3.5, 1.0], [3.0, 0.5]])  # of the published diamond [m]


@cache
def crane():
    return ClosedChain(load_model(load_robot("hiab_xs031")))


@cache
def task():
    return ToolTask(crane(), np.eye(3)[[0, 2]], ("extension",))


def quintic(s):
    """Rest to rest over s in [0, 1]: value, rate, acceleration."""
    return s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)


def leg(start, end, t, duration):
    """The path from one point of the task to another."""
    value, rate, acceleration = quintic(min(t / duration, 1.0))
    way = np.asarray(end) - start
    return Path(start + way * value, way * rate / duration, way * acceleration / duration**2)


class Loop:
    """States (z, zd, theta) of crane and controller: the true crane's parameters are scaled by `truth`."""

    def __init__(self, gains, share=1.0, learn=True):
        self.gains, self.learn, chain = gains, learn, crane()
        self.true = vdc.parameters(chain.model)
        self.controller = vdc.VdcController(chain, gains)
        self.controller.theta = share * self.true  # what the controller believes
        self.bounds = relative_bounds(self.true, 0.3)
        self.begin = task().position(chain.at(START, np.zeros(3)))
        self.end = self.begin + np.array([0.4, 0.5, 0.3])

    def rates(self, t, z, zd, theta):
        """Derivatives of the states, and nu."""
        state = crane().at(z, zd)
        required = required_motion(task(), state, leg(self.begin, self.end, t, 1.0), 3.0 * np.eye(3))
        self.controller.theta = theta
        force, motion = self.controller.forces(state, required)
        drive = np.einsum("bij,bi->bj", motion.regressor, motion.error)
        rate = projected_rate(theta, drive, self.gains.adaptation, *self.bounds) if self.learn else 0.0 * theta
        nu = vdc.accompanying(motion, self.true, theta, self.gains.adaptation)
        return (zd, state.acceleration(force), rate), nu

    def run(self, seconds=1.2, dt=5e-3, rates=(0.1, -0.15, 0.05)):
        """Nu at every step, Runge-Kutta 4."""
        y, history = (START, np.array(rates), self.controller.theta), []
        for k in range(round(seconds / dt)):
            y, nu = runge_kutta(lambda t, states: self.rates(t, *states), k * dt, y, dt)
            history.append(nu)
        return np.array(history)


def runge_kutta(rates, t, y, dt):
    """States after a step, and nu before it; `rates` gives derivatives and nu."""
    k1, nu = rates(t, y)
    k2, _ = rates(t + dt / 2, _plus(y, k1, dt / 2))
    k3, _ = rates(t + dt / 2, _plus(y, k2, dt / 2))
    k4, _ = rates(t + dt, _plus(y, k3, dt))
    slope = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return _plus(y, slope, dt), nu


def _plus(y, slope, dt):
    return tuple(a + dt * b for a, b in zip(y, slope, strict=True))


def growth(nu):
    """Largest rise of nu above what it had already fallen to, as a share of where it began."""
    return float((nu - np.minimum.accumulate(nu)).max() / nu[0])
