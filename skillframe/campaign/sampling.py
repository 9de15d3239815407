"""How quantities vary over a campaign, and their samples as a pure function of (campaign, trial).

  "start.tilt_y"   = { uniform = [-0.21, 0.21] }      independent, low <= x < high
  "start.offset_x" = { normal = [0.0, 0.002] }        independent, mean and standard deviation
  "world.friction" = { choice = [0.1, 0.2, 0.3] }     independent, each equally likely
  "start.tilt_x"   = { grid = [-0.1, 0.0, 0.1] }      every cell of the product of all grid axes
  "start.tilt_x"   = { grid = { from = -0.1, to = 0.1, count = 5 } }
  "start.offset_y" = { sobol = [-0.01, 0.01] }        all sobol axes together fill their box evenly
  "start.offset_z" = { values = [0.01, 0.02] }        one value per trial, in this order

Every independent quantity of every trial has its own generator,

  SeedSequence(seed, spawn_key=(trial, h(name))),   h = first 64 bits of SHA-256 of the quantity's name,

so another quantity or skill changes no other sample, and all skills see the same trials (common random numbers). Grid
axes follow the trial's number (see `spec`); sobol axes take the trial's point of one scrambled Sobol sequence over all
of them (scipy's linear matrix scramble with a digital shift). Sobol points have periods of 2, 4, ...; beside a grid or
values axis they are shuffled over the trials, so that each cell of the grid meets the whole box.
"""

from __future__ import annotations

import hashlib
import math
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.config import coerce
from skillframe.errors import InputError, UnknownName

Value = float | int | bool | str
KINDS = ("uniform", "normal", "choice", "grid", "sobol", "values")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One varied quantity.

    Attributes:
        kind: one of `KINDS`.
        numbers: low, high; mean, standard deviation; or the values.
    """

    kind: str
    numbers: tuple[Value, ...]

    def draw(self, rng: np.random.Generator) -> Value:
        """One sample of a "uniform", "normal" or "choice" axis."""
        if self.kind == "choice":
            return self.numbers[int(rng.integers(len(self.numbers)))]
        a, b = float(self.numbers[0]), float(self.numbers[1])
        if self.kind == "uniform":
            return a + (b - a) * float(rng.random())
        return a + b * float(rng.standard_normal())

    def plain(self) -> dict[str, list[Value]]:
        """The axis as it is written in TOML."""
        return {self.kind: list(self.numbers)}


def cells_of(vary: Mapping[str, Axis]) -> int:
    """Number of cells of the product of all grid axes. 1 without any."""
    return math.prod(len(axis.numbers) for axis in vary.values() if axis.kind == "grid")


def parse_axis(value: Any, where: str) -> Axis:
    """Read an axis from its TOML value.

    Raises:
        InputError: unknown kind, or numbers that do not fit it.
    """
    if not isinstance(value, Mapping) or len(value) != 1:
        raise InputError(
            where,
            f"expected one distribution, got {reprlib.repr(value)}",
            "write for example { uniform = [-0.1, 0.1] }",
        )
    ((kind, content),) = value.items()
    if kind not in KINDS:
        raise InputError(where, str(UnknownName("distribution", str(kind), KINDS)))
    where = f"{where}.{kind}"
    if kind in ("uniform", "sobol", "normal"):
        names = "mean, standard deviation" if kind == "normal" else "low, high"
        if not isinstance(content, list | tuple) or len(content) != 2:
            raise InputError(where, f"expected [{names}], got {content!r}")
        a, b = (_number(v, f"{where}[{i}]") for i, v in enumerate(content))
        if kind == "normal" and b < 0.0:
            raise InputError(where, f"standard deviation {b} is negative", "give zero or more")
        if kind != "normal" and not a < b:
            raise InputError(where, f"low {a} is not below high {b}", "write the smaller number first")
        return Axis(kind=kind, numbers=(a, b))
    if kind == "grid" and isinstance(content, Mapping):
        for key in content:
            if key not in ("from", "to", "count"):
                raise InputError(where, str(UnknownName("key", str(key), ("from", "to", "count"))))
        if len(content) != 3:
            raise InputError(where, f"expected from, to and count, got {dict(content)!r}")
        count: int = coerce(content["count"], int, f"{where}.count")
        if count < 2:
            raise InputError(f"{where}.count", f"is {count}", "give at least 2")
        first, last = (_number(content[key], f"{where}.{key}") for key in ("from", "to"))
        content = [float(v) for v in np.linspace(first, last, count)]
    if not isinstance(content, list | tuple):
        raise InputError(where, f"expected a list of values, got {content!r}")
    if not content:
        raise InputError(where, "is empty", "give at least one value")
    values = tuple(v if isinstance(v, bool | str | int) else _number(v, f"{where}[{i}]") for i, v in enumerate(content))
    if kind == "grid" and len(set(values)) != len(values):
        raise InputError(where, f"holds a value twice: {content!r}", "give every value of a grid once")
    return Axis(kind=kind, numbers=values)


def _number(value: Any, where: str) -> float:
    number: float = coerce(value, float, where)
    if not math.isfinite(number):
        raise InputError(where, f"is {number}", "give a finite number")
    return number


Draws = dict[str, NDArray[Any]]


class Design(Protocol):
    """What samples depend on: a `skillframe.campaign.spec.CampaignSpec`."""

    @property
    def seed(self) -> int:
        """Of every sample."""

    @property
    def trials(self) -> int:
        """Number per skill."""

    @property
    def vary(self) -> Mapping[str, Axis]:
        """Axes by quantity."""


RUN = "run"
"""Key of a trial's own generator (sensor noise, random skills)."""


def seed_sequence(seed: int, trial: int, name: str) -> np.random.SeedSequence:
    """The seed sequence of one quantity in one trial."""
    key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.SeedSequence(seed, spawn_key=(trial, key))


def trial_rng(seed: int, trial: int) -> np.random.Generator:
    """A fresh generator for a trial's run."""
    return np.random.default_rng(seed_sequence(seed, trial, RUN))


def trial_rngs(seed: int, trials: Sequence[int]) -> list[np.random.Generator]:
    """`trial_rng` of several trials."""
    return [trial_rng(seed, trial) for trial in trials]


def draws(spec: Design, trials: Sequence[int]) -> Draws:
    """Sample the varied quantities of some trials.

    Returns:
        (n,) array by quantity: float64, or the type of a choice's values.
    """
    result: Draws = {}
    stride = 1
    for name in sorted(n for n, axis in spec.vary.items() if axis.kind == "grid"):
        numbers = spec.vary[name].numbers
        result[name] = _column([numbers[trial // stride % len(numbers)] for trial in trials])
        stride *= len(numbers)
    result |= _sobol(spec, trials)
    for name, axis in spec.vary.items():
        if axis.kind == "values":
            result[name] = _column([axis.numbers[trial] for trial in trials])
        elif name not in result:
            rngs = (np.random.default_rng(seed_sequence(spec.seed, trial, name)) for trial in trials)
            result[name] = _column([axis.draw(rng) for rng in rngs])
    return {name: result[name] for name in spec.vary}


def _column(values: list[Value]) -> NDArray[Any]:
    alike = len({type(value) for value in values}) <= 1
    return np.array(values) if alike else np.array(values, dtype=object)


def _sobol(spec: Design, trials: Sequence[int]) -> Draws:
    names = sorted(n for n, axis in spec.vary.items() if axis.kind == "sobol")
    if not names or not len(trials):
        return {name: np.zeros(0) for name in names}
    from scipy.stats import qmc

    places = own = np.asarray(trials, dtype=np.intp)
    if cells_of(spec.vary) != 1 or any(axis.kind == "values" for axis in spec.vary.values()):  # axes that run in order
        order = np.random.default_rng(seed_sequence(spec.seed, 0, "sobol order")).permutation(spec.trials)
        places = order[own]
    scramble = np.random.default_rng(seed_sequence(spec.seed, 0, "sobol"))
    sobol = qmc.Sobol(len(names), scramble=True, rng=scramble)
    points = sobol.random_base2(max(1, int(places.max()).bit_length()))[places]  # a power of two of them
    ends = [(float(spec.vary[n].numbers[0]), float(spec.vary[n].numbers[1])) for n in names]
    return {
        name: low + (high - low) * points[:, i] for i, (name, (low, high)) in enumerate(zip(names, ends, strict=True))
    }
