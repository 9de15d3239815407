"""Analysis of a foreign table: its columns, units, orientation and wrench."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skillframe.demonstration import (
    EULER,
    KNOWN,
    MATRIX,
    NANOSECONDS,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    SCALES,
    SECONDS,
    WRENCH,
    Table,
    spread,
)
from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe_recordings.proposal import headers, names, values
from skillframe_recordings.proposal.orientations import (
    Choice,
    OrientationReading,
    Witness,
    angle_readings,
    choose,
    quaternion_readings,
    vector_reading,
)
from skillframe_recordings.proposal.wrenches import Known, judge_wrench
from skillframe_recordings.thresholds import PROPOSAL

PERIODS, RATES = ("dt", "ts", "period"), ("fs", "rate", "freq", "frequency", "hz")
"""Names of single numbers that are a sample period [s] or rate [Hz]."""
ORIENTATIONS = (QUATERNION, EULER, ROTATION_VECTOR, MATRIX)
SI = ("s", "m", "rad", "N", "Nm")


@dataclass(slots=True)
class Said:
    """Settings and sentences found so far."""

    settings: dict[str, str] = field(default_factory=dict)
    because: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def picked(table: Table, pose: bool, arm: str | None, doubts: list[str]) -> headers.Picks:
    """Return columns by skillframe's names, from the header, else from values. Text is excluded except dates.

    Args:
        table: as read.
        pose: whether six numbers are a pose, as the wrench is in another file.
        arm: the body to read, or None.
        doubts: receives open questions.
    """
    if not table.names:
        return headers.Picks(values.picks_by_value(table.values, pose, doubts), numbered=True)
    found = headers.picks(table.names, table.values, arm)
    kept = {n: i for n, i in found.columns.items() if i not in table.text or (n == "t" and i in table.stamps)}
    if kept.keys() - {"t"} or table.text:
        return found._replace(columns=kept)
    longest = max((g.ordered() for g in names.groups_of(table.names)), key=len, default=[])
    if len(longest) < len(WRENCH):
        return found._replace(columns=kept)
    told = values.picks_by_value(table.values[:, longest], pose, doubts)  # one array of numbers without names
    return headers.Picks({**{n: longest[i] for n, i in told.items()}, **kept}, numbered=True)


def spec_of(table: Table, picks: Mapping[str, int]) -> str:
    """Return `--set columns` for these columns, by name where possible, else by number."""
    if not table.names:
        by_index = {index: name for name, index in picks.items()}
        return ",".join(by_index.get(i, "_") for i in range(table.values.shape[1]))
    fit = [table.names.count(n) == 1 and not set(n) & set(",=\n") and not n.isdigit() for n in table.names]
    return ",".join(f"{name}={table.names[i] if fit[i] else i + 1}" for name, i in picks.items())


def whole_clock(table: Table, picks: Mapping[str, int]) -> Float | None:
    """Return the clock (T,) in its own unit, or None."""
    if SECONDS in picks and NANOSECONDS in picks:
        return np.asarray(table.values[:, picks[SECONDS]] + 1e-9 * table.values[:, picks[NANOSECONDS]])
    if "t" not in picks:
        return None
    clock = table.stamps.get(picks["t"], table.values[:, picks["t"]])
    return spread(clock) if np.all(np.diff(clock) >= 0.0) else clock


class Look:
    """Analysis of one table.

    Args:
        table: as read.
        said: receives settings and sentences.
        given: given reading settings.
        alone: whether the table should hold the wrench too.

    Raises:
        InputError: no column of a demonstration was recognised.
    """

    def __init__(self, table: Table, said: Said, given: Mapping[str, Any], alone: bool) -> None:
        self.table, self.said, self.given = table, said, given
        arm = None if given.get("arm") is None else str(given["arm"])
        self.header = picked(table, not alone, arm, said.missing)
        self.picks = dict(self.header.columns)
        self.elsewhere = not alone
        if not self.picks.keys() - {"t"} and not said.missing:
            has = (
                f"its header is {', '.join(table.names)}" if table.names else f"it has {table.values.shape[1]} columns"
            )
            raise InputError(table.source, f"shows no pose and no wrench; {has}", "name the columns with --set columns")
        for other in self.header.others:
            said.undecided.append(
                f"whose recording is wanted: this line reads {self.header.body}; for {other} add --set "
                f"{shlex.quote(f'arm={other}')} to --layout auto"
            )
        self.units = [unit for unit in str(given.get("units") or "").split(",") if unit]
        self.told = names.said_units(table.names, self.picks) if table.names and not self.units else {}
        self.units += [unit for unit in self.told.values() if unit not in SI]
        count = min(50_000, len(table.values))  # longer tables are thinned evenly
        rows = np.linspace(0, len(table.values) - 1, count).round().astype(int)
        own = [i for n, i in self.picks.items() if n not in WRENCH and i not in self.table.text]
        self._rows = rows[np.all(np.isfinite(self.table.values[rows][:, own or list(self.picks.values())]), axis=1)]
        self.start, self.time = self._clock()
        extra = headers.helpers(table.names) if table.names else {}
        self.speed, self.spin, self.acceleration = map(self._three, map(extra.get, ("speed", "spin", "acceleration")))
        self.position = self._position()
        force = self._three([self.picks[n] for n in WRENCH[:3] if n in self.picks])
        self.force = None if force is None else force * self._factor("force")

    @property
    def native(self) -> bool:
        """Whether all columns have the contract's names."""
        return bool(self.table.names) and all(self.table.names[i] == name for name, i in self.picks.items())

    @property
    def spec(self) -> str:
        """`--set columns` for the recognised columns."""
        return spec_of(self.table, self._ordered(self.picks))

    @staticmethod
    def _ordered(picks: Mapping[str, int]) -> dict[str, int]:
        order = {name: i for i, name in enumerate(("t", SECONDS, NANOSECONDS, *POSITION, *KNOWN))}
        return dict(sorted(picks.items(), key=lambda pick: order[pick[0]]))

    def _column(self, index: int) -> Float:
        column = self.table.values[:, index]
        there = np.isfinite(column)
        if there.all() or not there.any():
            return np.asarray(np.nan_to_num(column[self._rows]))
        rows = np.arange(len(column), dtype=float)
        return np.asarray(np.interp(self._rows, rows[there], column[there]))

    def _three(self, columns: Sequence[int] | None) -> Float | None:
        return np.stack([self._column(i) for i in columns], axis=-1) if columns and len(columns) == 3 else None

    def _factor(self, quantity: str) -> float:
        return next((SCALES[quantity][unit] for unit in self.units if unit in SCALES[quantity]), 1.0)

    def _has_unit(self, quantity: str) -> bool:
        return quantity in self.told or any(unit in SCALES[quantity] for unit in self.units)

    def _clock(self) -> tuple[float, Float]:
        """First stamp, and the rows' times from it [s]. 100 Hz is assumed without a clock."""
        self._rate_beside()
        clock = whole_clock(self.table, self.picks)
        time = None if clock is None else clock[self._rows]
        rate = self.given.get("rate") or self.said.settings.get("rate")
        if time is not None and not rate and np.any(later := np.diff(time, prepend=-np.inf) > 0.0):
            self._rows, time = self._rows[later], time[later]  # equal stamps tell nothing of the motion between them
        if time is None or rate or len(time) < 3 or np.any(np.diff(time) <= 0.0):
            return 0.0, np.arange(len(self._rows)) / float(rate or 100.0)
        if self.picks.get("t") in self.table.stamps or SECONDS in self.picks:
            kind = "seconds and nanoseconds in two columns" if SECONDS in self.picks else "dates or times of day"
            self.said.because.append(f"clock: {kind}")
            return float(time[0]), time - time[0]
        if "time" in self.told:
            self.said.because.append(f"clock: in {self.told['time']}, as the header says")
        elif not self._has_unit("time"):
            unit = values.unit_of_time(time)
            if unit is None:
                self.said.undecided.append(
                    "the clock's unit: no usual one gives 5 to 5000 samples a second (--set units)"
                )
            else:
                self.units += [unit] if unit != "s" else []
                rate = 1.0 / (float(np.median(np.diff(time))) * SCALES["time"][unit])
                self.said.because.append(f"clock: in {unit} its rate is {rate:.4g} Hz")
        return float(time[0]) * self._factor("time"), (time - time[0]) * self._factor("time")

    def _rate_beside(self) -> None:
        """Take a single sample period or rate, "dt" or "fs", if there is no clock."""
        if self.given.get("rate") or self.picks.keys() & {"t", SECONDS}:
            return
        for name, value in self.table.single.items():
            word = (names.cut(name)[0] or ("",))[-1]
            if value > 0.0 and word in (*PERIODS, *RATES):
                rate = value if word in RATES else 1.0 / value
                self.said.settings["rate"] = f"{rate:.9g}"
                self.said.because.append(f"clock: {rate:.9g} Hz, since the file says {name} = {value:.9g}")
                return

    def _position(self) -> Float | None:
        position = self._three([self.picks[n] for n in POSITION if n in self.picks])
        if position is None or len(position) < 3:
            return None
        if "length" in self.told:
            self.said.because.append(f"position: in {self.told['length']}, as the header says")
        elif not self._has_unit("length"):
            unit, reason = values.unit_of_length(position, self.speed, self.time)
            if unit is None:
                self.said.undecided.append(f"the unit of positions: {reason}")
            else:
                self.said.because.append(f"position: in {unit}, since {reason}")
            self.units += [unit] if unit not in (None, "m") else []
        return position * self._factor("length")

    def take_wrench(self, table: Table) -> None:
        """Find the columns of a separate wrench file, and interpolate its force at the pose's times."""
        picks = picked(table, False, None, []).columns
        own = {n: picks[n] for n in ("t", SECONDS, NANOSECONDS, *WRENCH) if n in picks}
        self.said.settings["wrench_columns"] = spec_of(table, own)
        if not set(WRENCH) <= own.keys():
            self.said.missing.append(f"a wrench in {table.source}: name its columns with --set wrench-columns")
            return
        clock = whole_clock(table, own)
        if clock is None or len(clock) < 3 or np.any(np.diff(clock) < 0.0) or not np.all(np.isfinite(clock)):
            return
        told = names.said_units(table.names, own).get("time") if table.names else None
        unit = told or values.unit_of_time(clock) or "s"
        unit = "s" if own.get("t") in table.stamps or SECONDS in own else unit
        if unit != next((u for u in self.units if u in SCALES["time"]), "s"):
            self.said.settings["wrench_units"] = unit
        at = clock * SCALES["time"][unit] - self.start
        force = [np.interp(self.time, at, table.values[:, own[name]]) for name in WRENCH[:3]]
        self.force = np.stack(force, axis=-1) * self._factor("force")

    def orientation(self) -> Choice | None:
        """Choose the orientation's format and unit."""
        form = next((names for names in ORIENTATIONS if set(names) <= self.picks.keys()), None)
        if form is None or len(self._rows) < 3:
            return None
        witness = Witness(self.time, self.force, self.spin, self.acceleration)
        if form is QUATERNION:
            return self._quaternion(witness)
        raw = np.stack([self._column(self.picks[name]) for name in form], axis=-1)
        return self._matrix(raw, witness) if form is MATRIX else self._angles(form, raw, witness)

    def _quaternion(self, witness: Witness) -> Choice | None:
        indices = sorted(self.picks[name] for name in QUATERNION)
        raw = np.stack([self._column(i) for i in indices], axis=-1)
        length = norm(raw)
        if np.abs(length - 1.0).max() > PROPOSAL.norm:
            range_ = f"{length.min():.3g} to {length.max():.3g}"
            self.said.missing.append(f"a quaternion: the columns named so have norms from {range_}")
            return None
        raw = raw / length[:, None]
        matlab = self.header.numbered and self.table.source.lower().endswith(".mat")  # whose quaternions begin with w
        prior = "wxyz" if matlab or self.picks["qw"] == indices[0] else "xyzw"
        choice = choose(quaternion_readings(raw), prior, witness, raw)
        order = QUATERNION if choice.name == "xyzw" else ("qw", *QUATERNION[:3])
        self.picks.update(zip(order, indices, strict=True))
        said = "" if self.header.numbered else f", as the header {'says' if choice.name == prior else 'does not say'}"
        self._tell("quaternion", choice.name + said, choice)
        if not choice.sure and self.header.numbered:
            other = spec_of(
                self.table,
                self._ordered(
                    {
                        **self.picks,
                        **dict(
                            zip(
                                ("qw", *QUATERNION[:3]) if tuple(order) == QUATERNION else QUATERNION,
                                indices,
                                strict=True,
                            )
                        ),
                    }
                ),
            )
            self.said.undecided[-1] += f"; the other order is --set columns={shlex.quote(other)}"
        return choice

    def _matrix(self, raw: Float, witness: Witness) -> Choice:
        matrix = raw.reshape(-1, 3, 3)
        if set(POSITION) <= self.picks.keys() and abs(self.picks["px"] - self.picks["r11"]) in (3, 12):
            which = "by columns" if self.picks["r21"] - self.picks["r11"] == 1 else "by rows"
            self.said.because.append(f"rotation matrix: {which}, as its last row 0 0 0 1 stands")
            return Choice(which, matrix, "", True)
        readings = [
            OrientationReading("by rows", matrix),
            OrientationReading("by columns", np.swapaxes(matrix, -1, -2)),
        ]
        choice = choose(readings, "by rows", witness)
        if choice.name == "by columns":
            columns = [self.picks[name] for name in MATRIX]
            self.picks.update({f"r{i + 1}{j + 1}": columns[3 * j + i] for i in range(3) for j in range(3)})
        self._tell("rotation matrix", choice.name, choice)
        return choice

    def _angles(self, form: Sequence[str], raw: Float, witness: Witness) -> Choice:
        if not self._has_unit("angle"):
            unit, reason = values.unit_of_angle(raw)
            self.said.because.append(f"angles: in {unit}, since {reason}")
            self.units += ["deg"] if unit == "deg" else []
        raw = raw * self._factor("angle")
        vector = form is ROTATION_VECTOR
        readings = [*([vector_reading(raw)] if vector else []), *angle_readings(raw)]
        named = str(self.given.get("euler") or "ZYX")
        choice = choose(readings, "vector" if vector else named if named.isupper() else named[::-1].upper(), witness)
        if choice.name != "vector":
            columns = [self.picks.pop(name) for name in form]
            self.picks.update(zip(EULER, columns, strict=True))
            self.said.settings.setdefault("euler", choice.name)
        which = "rotation vector" if choice.name == "vector" else f"Euler angles about moving {choice.name}"
        self._tell("orientation", which, choice)
        return choice

    def _tell(self, what: str, which: str, choice: Choice) -> None:
        if choice.sure:
            self.said.because.append(f"{what}: {which}; {choice.reason}")
        else:
            self.said.undecided.append(f"{what}: {which} is assumed; {choice.reason}")

    def judge_wrench(self, choice: Choice | None) -> None:
        """Find axes and sign of the wrench."""
        if choice is None or self.force is None:
            return
        frame, sign, said = self.given.get("wrench_frame"), self.given.get("wrench_sign"), ""
        if frame is None and "fx" in self.picks and self.table.names:
            frame, said = headers.said_frame(self.table, self.picks["fx"])
        named = not self.header.numbered and "euler" not in self.said.settings
        verdict = judge_wrench(
            self.time, self.position, choice.rotation, self.force, Known(frame, sign, said, choice.sure or named)
        )
        self.said.because += verdict.reasons
        (self.said.missing if verdict.excluded else self.said.undecided).extend(verdict.open)
        for name, value in (("wrench_frame", verdict.frame), ("wrench_sign", verdict.sign)):
            if value is not None and name not in self.given:
                self.said.settings[name] = value
        if verdict.weighs:
            self.said.settings.setdefault("wrench_includes_tool_weight", "")
            self.said.undecided.append("the tool's weight and its bias: skillframe calibrate finds and takes them off")

    def take_poses_at_rest(self) -> None:
        """Take a table with neither clock nor position as poses at rest for `calibrate`: at 1 Hz, at one position."""
        has, given = self.picks.keys(), self.given
        if has & {"t", SECONDS, *POSITION} or given.get("rate") or given.get("position") or not has & {*WRENCH}:
            return
        if not any(set(names) <= has for names in ORIENTATIONS):
            return
        self.said.settings |= {"rate": "1", "position": "0,0,0"}
        self.said.undecided.append("neither clock nor position: taken as poses at rest, for skillframe calibrate")
        for name in ("wrench_frame", "wrench_includes_tool_weight"):  # calibrate sets these itself
            self.said.settings.pop(name, None)

    def say_what_is_missing(self) -> None:
        """List required columns that were not recognised."""
        has, missing = self.picks.keys(), self.said.missing
        if missing and not has - {"t"}:
            return  # unrecognised columns come before missing ones
        if "t" not in has and SECONDS not in has and not (self.given.get("rate") or "rate" in self.said.settings):
            missing.append("a clock: add --set rate=HZ")
        if not set(POSITION) <= has and not (self.given.get("position") or "position" in self.said.settings):
            missing.append(
                "a position: add px, py, pz to columns, or --set position=0,0,0 for a recording of orientations"
            )
        if not any(set(names) <= has for names in ORIENTATIONS):
            missing.append(
                "an orientation: add qx, qy, qz, qw (roll, pitch, yaw; rvx, rvy, rvz; r11 ... r33) to --set columns"
            )
        lacking = [name for name in WRENCH if name not in has]
        if lacking == list(WRENCH[3:]) and not self.elsewhere:
            self.said.undecided.append(
                "torque: no column is called so, and forces alone are read; name tx, ty, tz if the table holds them"
            )
        elif lacking and not self.elsewhere:
            missing.append(f"a wrench ({', '.join(lacking)}): add its columns, or its file with --set wrench")
