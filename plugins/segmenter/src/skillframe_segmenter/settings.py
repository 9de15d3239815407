"""The segmenters' constants, all changeable with `segment --set NAME=VALUE`.

None of them is printed in the papers; they are our choice, from comparisons on simulated tasks and real recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from skillframe.errors import InputError

WINDOW_S = 0.05
FEWEST_PER_PHASE = 4
"""Windows without which nothing can be learned of a phase."""
PHASE_MIN_S = FEWEST_PER_PHASE * WINDOW_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """What the segmenters go by, wherever they look from.

    Attributes:
        temper: weight of a window's likelihood in a demonstration of `temper_windows` windows; windows are correlated,
            so a demonstration counts as about 30 samples however finely it is cut.
        temper_windows: see `temper`; longer demonstrations are weighted down to a tenth of it.
        stay_s: mean time a phase is expected to last before the data are seen [s].
        phases_max: largest number of phases tried where the number is not given.
        merge_angle_rad: motion this far from what one desired direction explains still belongs to it: larger joins more
            phases into one.
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
    """What the segmenters go by.

    Attributes:
        axes: "base", or "phase_start": the tool's attitude at the start of the demonstration.
        at: point of the tool frame whose motion and wrench are looked at; None for the recorded tool point.
    """

    axes: str = "base"
    at: str | None = None

    def __post_init__(self) -> None:
        Cutting.__post_init__(self)
        if self.axes not in ("base", "phase_start"):
            raise InputError("--axes", f"{self.axes!r} is neither base nor phase_start", "choose one of the two")


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySettings(Cutting):
    """What `learn --skill policy --set` can change. The other keys go to the learner of the phases.

    Attributes:
        segmenter: what cuts demonstrations into phases: wrench_hmm, pose_hmm or zvc. The settings of `zvc` are `still`
            and `force_n`; all others here are those of the first two.
        skill: what each phase is learned as; its own settings can be given as well, see `plugins show lmc`.
        phases: how many there are; found where it is not given.
        recoveries: how often a run may go back to an earlier phase.
        set_boundary: a list of "DEMONSTRATION:BOUNDARY=SECONDS" that a person has moved, counted as they stand without.
        places: learn in the frames of the places that the recordings name; where they name none it says nothing.
    """

    segmenter: str = "wrench_hmm"
    skill: str = "lmc"
    phases: int | None = None
    recoveries: int = 1
    set_boundary: tuple[str, ...] | None = None
    places: bool = True
