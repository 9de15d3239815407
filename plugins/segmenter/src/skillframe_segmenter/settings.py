"""The segmenters' constants, set with `segment --set NAME=VALUE`.

The papers print none; these are from comparisons on simulated tasks and real recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from skillframe.errors import InputError

WINDOW_S = 0.05
FEWEST_PER_PHASE = 4
"""Fewest windows to learn a phase from."""
PHASE_MIN_S = FEWEST_PER_PHASE * WINDOW_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """Settings of all segmenters.

    Attributes:
        temper: weight of a window's likelihood in a demonstration of `temper_windows` windows; windows are correlated,
            so a demonstration counts as about 30 samples.
        temper_windows: see `temper`; longer demonstrations are weighted down to a tenth of it.
        stay_s: prior mean duration of a phase [s].
        phases_max: largest number of phases tried where the number is not given.
        merge_angle_rad: deviation from one desired direction that still belongs to it; larger joins more phases.
        merge_votes: least share of windows that one direction must explain for two phases to be one.
        switch_posterior, switch_windows: online, a phase takes over when it is this probable for so many windows.
    """

    temper: float = 0.3
    temper_windows: int = 100
    stay_s: float = 1.0
    phases_max: int = 7
    merge_angle_rad: float = radians(25.0)
    merge_votes: float = 0.6
    switch_posterior: float = 0.8
    switch_windows: int = 2

    def __post_init__(self) -> None:
        for name in ("temper", "temper_windows", "stay_s", "phases_max", "merge_angle_rad", "merge_votes"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise InputError(f"--set {name}", f"{getattr(self, name)} is not a positive number", "fix it")
        if self.phases_max > 20:
            raise InputError("--set phases_max", f"{self.phases_max} is more than 20", "give a smaller number")
        if not 0.5 <= self.switch_posterior < 1.0 or self.switch_windows < 1:
            raise InputError("--set", "switch_posterior is within 0.5 and 1, switch_windows at least 1", "fix it")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(Cutting):
    """Settings of the model-based segmenters.

    Attributes:
        axes: "base", or "phase_start": the tool's orientation at the start of the demonstration.
        at: observed point of the tool frame; None for the recorded tool point.
    """

    axes: str = "base"
    at: str | None = None

    def __post_init__(self) -> None:
        Cutting.__post_init__(self)
        if self.axes not in ("base", "phase_start"):
            raise InputError("--axes", f"{self.axes!r} is neither base nor phase_start", "choose one of the two")


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySettings(Cutting):
    """Settings of `learn --skill policy --set`, whose other keys go to the learner of the phases.

    Attributes:
        segmenter: wrench_hmm, pose_hmm or zvc. The settings of `zvc` are `still` and `force_n`; all others here are
            those of the first two.
        skill: kind of skill of each phase, which has its own settings, see `plugins lmc`.
        phases: number of phases; found where it is not given.
        recoveries: how often a run may go back to an earlier phase.
        set_boundary: a list of "DEMONSTRATION:BOUNDARY=SECONDS" that the user moved, counted as they stand without.
        places: learn in the frames of the places that the recordings name, if any.
    """

    segmenter: str = "wrench_hmm"
    skill: str = "lmc"
    phases: int | None = None
    recoveries: int = 1
    set_boundary: tuple[str, ...] | None = None
    places: bool = True
