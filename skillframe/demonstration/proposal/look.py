"""A foreign table as it is looked through: its picks, units, and the columns that bear on others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skillframe.demonstration.columns import (
    EULER,
    KNOWN,
    MATRIX,
    NANOSECONDS,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    SECONDS,
    WRENCH,
)
from skillframe.demonstration.options import SCALES
from skillframe.demonstration.proposal import headers, values
from skillframe.demonstration.proposal.attitudes import (
    AttitudeReading,
    Choice,
    Witness,
    angle_readings,
    choose,
    quaternion_readings,
    vector_reading,
)
from skillframe.demonstration.proposal.wrenches import judge_wrench
from skillframe.demonstration.table import Table
from skillframe.errors import InputError
from skillframe.frames import Float, norm

MOST_ROWS = 50_000
"""Rows that are looked at; longer tables are thinned out evenly."""
ATTITUDES = (QUATERNION, EULER, ROTATION_VECTOR, MATRIX)
SI = ("s", "m", "rad", "N", "Nm")


@dataclass(slots=True)
class Said:
    """What is said so far: settings, and sentences."""

    settings: dict[str, str] = field(default_factory=dict)
    because: list[str] = field(default_factory=list)
    undecided: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def picked(table: Table, pose: bool) -> dict[str, int]:
    """Columns by our names, from the header or else the values. Words are no numbers, but dates are a clock."""
    if not table.names:
        return values.picks_by_value(table.values, pose)
    found = headers.picks(table.names)
    return {n: i for n, i in found.items() if i not in table.text or (n == "t" and i in table.stamps)}


def spec_of(table: Table, picks: Mapping[str, int]) -> str:
    """`--columns` for these picks: by header where its names can stand there, else by number."""
    if not table.names:
        by_index = {index: name for name, index in picks.items()}
        return ",".join(by_index.get(i, "_") for i in range(table.values.shape[1]))
    fit = [table.names.count(n) == 1 and not set(n) & set(",=\n") and not n.isdigit() for n in table.names]
    return ",".join(f"{name}={table.names[i] if fit[i] else i + 1}" for name, i in picks.items())


def whole_clock(table: Table, picks: Mapping[str, int]) -> Float | None:
    """The clock (T,) in its own unit, or None where there is none that increases."""
    if SECONDS in picks and NANOSECONDS in picks:
        return np.asarray(table.values[:, picks[SECONDS]] + 1e-9 * table.values[:, picks[NANOSECONDS]])
    if "t" not in picks:
        return None
    return table.stamps.get(picks["t"], table.values[:, picks["t"]])


class Look:
    """One table as it is looked through.

    Args:
        table: as read.
        said: takes settings and sentences.
        given: reading settings that were given.
        alone: whether the wrench is expected in it too.

    Raises:
        InputError: no column of a demonstration was recognised.
    """

    def __init__(self, table: Table, said: Said, given: Mapping[str, Any], alone: bool) -> None:
        self.table, self.said, self.given = table, said, given
        self.picks = picked(table, not alone)
        self.elsewhere = not alone
        if not self.picks.keys() - {"t"}:
            has = (
                f"its header is {', '.join(table.names)}" if table.names else f"it has {table.values.shape[1]} columns"
            )
            raise InputError(table.source, f"shows no pose and no wrench; {has}", "name the columns with --columns")
        self.units = [unit for unit in str(given.get("units") or "").split(",") if unit]
        if table.names and not self.units:
            self.units = [u for u in headers.said_units(table.names, self.picks.values()) if u not in SI]
        rows = np.linspace(0, len(table.values) - 1, min(MOST_ROWS, len(table.values))).round().astype(int)
        self._rows = rows[self._complete(rows)]
        self.start, self.time = self._clock()
        extra = headers.helpers(table.names) if table.names else {}
        self.speed, self.spin, self.acceleration = map(self._three, map(extra.get, ("speed", "spin", "acceleration")))
        self.position = self._position()
        force = self._three([self.picks[n] for n in WRENCH[:3] if n in self.picks])
        self.force = None if force is None else force * self._factor("force")

    @property
    def native(self) -> bool:
        """Whether the header names every column as the contract does."""
        return bool(self.table.names) and all(self.table.names[i] == name for name, i in self.picks.items())

    @property
    def spec(self) -> str:
        """`--columns` for what was recognised."""
        order = {name: i for i, name in enumerate(("t", SECONDS, NANOSECONDS, *POSITION, *KNOWN))}
        return spec_of(self.table, dict(sorted(self.picks.items(), key=lambda pick: order[pick[0]])))

    def _complete(self, rows: Any) -> Any:
        """Rows in which the pose stands. A wrench that stands elsewhere is interpolated at them."""
        own = [i for n, i in self.picks.items() if n not in WRENCH and i not in self.table.text]
        return np.all(np.isfinite(self.table.values[rows][:, own or list(self.picks.values())]), axis=1)

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
        return any(unit in SCALES[quantity] for unit in self.units)

    def _clock(self) -> tuple[float, Float]:
        """First stamp, and seconds of the rows from it on. It is 100 Hz where there is none, for judgements alone."""
        clock = whole_clock(self.table, self.picks)
        time = None if clock is None else clock[self._rows]
        if time is None or self.given.get("rate") or len(time) < 3 or np.any(np.diff(time) <= 0.0):
            return 0.0, np.arange(len(self._rows)) / float(self.given.get("rate") or 100.0)
        if self.picks.get("t") in self.table.stamps or SECONDS in self.picks:
            kind = "seconds and nanoseconds in two columns" if SECONDS in self.picks else "dates or times of day"
            self.said.because.append(f"clock: {kind}")
            return float(time[0]), time - time[0]
        if not self._has_unit("time"):
            self._unit_of_time(time)
        return float(time[0]) * self._factor("time"), (time - time[0]) * self._factor("time")

    def _unit_of_time(self, time: Float) -> None:
        unit = values.unit_of_time(time)
        if unit is None:
            self.said.undecided.append("the clock's unit: no usual one gives 5 to 5000 samples a second (--units)")
            return
        self.units += [unit] if unit != "s" else []
        rate = 1.0 / (float(np.median(np.diff(time))) * SCALES["time"][unit])
        self.said.because.append(f"clock: in {unit} its rate is {rate:.4g} Hz")

    def _position(self) -> Float | None:
        position = self._three([self.picks[n] for n in POSITION if n in self.picks])
        if position is None or len(position) < 3:
            return None
        if not self._has_unit("length"):
            unit, reason = values.unit_of_length(position, self.speed, self.time)
            self.said.because.append(f"position: in {unit}, since {reason}")
            self.units += [unit] if unit != "m" else []
        return position * self._factor("length")

    def take_wrench(self, table: Table) -> None:
        """The columns of a wrench in a file of its own, and its force at the pose's times."""
        picks = picked(table, pose=False)
        own = {n: picks[n] for n in ("t", SECONDS, NANOSECONDS, *WRENCH) if n in picks}
        self.said.settings["wrench_columns"] = spec_of(table, own)
        if not set(WRENCH) <= own.keys():
            self.said.missing.append(f"a wrench in {table.source}: name its columns with --wrench-columns")
            return
        clock = whole_clock(table, own)
        if clock is None or len(clock) < 3 or np.any(np.diff(clock) <= 0.0) or not np.all(np.isfinite(clock)):
            return
        unit = values.unit_of_time(clock) or "s"
        unit = "s" if own.get("t") in table.stamps or SECONDS in own else unit
        if unit != next((u for u in self.units if u in SCALES["time"]), "s"):
            self.said.settings["wrench_units"] = unit
        at = clock * SCALES["time"][unit] - self.start
        force = [np.interp(self.time, at, table.values[:, own[name]]) for name in WRENCH[:3]]
        self.force = np.stack(force, axis=-1) * self._factor("force")

    def attitude(self) -> Choice | None:
        """The attitude's form, order and unit, as picks and settings."""
        form = next((names for names in ATTITUDES if set(names) <= self.picks.keys()), None)
        if form is None or len(self._rows) < 3:
            return None
        witness = Witness(self.time, self.position, self.force, self.spin, self.acceleration)
        if form is QUATERNION:
            return self._quaternion(witness)
        raw = np.stack([self._column(self.picks[name]) for name in form], axis=-1)
        return self._matrix(raw, witness) if form is MATRIX else self._angles(form, raw, witness)

    def _quaternion(self, witness: Witness) -> Choice | None:
        indices = sorted(self.picks[name] for name in QUATERNION)
        raw = np.stack([self._column(i) for i in indices], axis=-1)
        length = norm(raw)
        if np.abs(length - 1.0).max() > values.NORM:
            range_ = f"{length.min():.3g} to {length.max():.3g}"
            self.said.missing.append(f"a quaternion: the columns named so have norms from {range_}")
            return None
        raw = raw / length[:, None]
        prior = "wxyz" if self.picks["qw"] == indices[0] else "xyzw"
        choice = choose(quaternion_readings(raw), prior, witness, raw)
        order = QUATERNION if choice.name == "xyzw" else ("qw", *QUATERNION[:3])
        self.picks.update(zip(order, indices, strict=True))
        said = f", as the header {'says' if choice.name == prior else 'does not say'}" if self.table.names else ""
        self._tell("quaternion", choice.name + said, choice)
        return choice

    def _matrix(self, raw: Float, witness: Witness) -> Choice:
        matrix = raw.reshape(-1, 3, 3)
        readings = [AttitudeReading("by rows", matrix), AttitudeReading("by columns", np.swapaxes(matrix, -1, -2))]
        choice = choose(readings, "by rows", witness)
        if choice.name == "by columns":
            columns = [self.picks[name] for name in MATRIX]
            self.picks.update({f"r{i + 1}{j + 1}": columns[3 * j + i] for i in range(3) for j in range(3)})
        self._tell("rotation matrix", choice.name, choice)
        return choice

    def _angles(self, form: Sequence[str], raw: Float, witness: Witness) -> Choice:
        """Angles about three axes, or a rotation vector, in radians or degrees."""
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
        self._tell("attitude", which, choice)
        return choice

    def _tell(self, what: str, which: str, choice: Choice) -> None:
        if choice.sure:
            self.said.because.append(f"{what}: {which}; {choice.reason}")
        else:
            self.said.undecided.append(f"{what}: {which} is assumed; {choice.reason}")

    def judge_wrench(self, choice: Choice | None) -> None:
        """Axes and sign of the wrench."""
        if choice is None or self.force is None:
            return
        known = "fx" in self.picks and self.table.names
        said = headers.said_frame(self.table.names, self.picks["fx"]) if known else None
        verdict = judge_wrench(self.time, self.position, choice.rotation, self.force, said)
        self.said.because += verdict.reasons
        self.said.undecided += verdict.open
        for name, value in (("wrench_frame", verdict.frame), ("wrench_sign", verdict.sign)):
            if value is not None and name not in self.given:
                self.said.settings[name] = value
        if verdict.weighs:
            self.said.settings.setdefault("wrench_includes_tool_weight", "")
            self.said.undecided.append("the tool's weight and its bias: skillframe calibrate finds and takes them off")

    def say_what_is_missing(self) -> None:
        """What no column was recognised as."""
        has, missing = self.picks.keys(), self.said.missing
        if "t" not in has and SECONDS not in has and not self.given.get("rate"):
            missing.append("a clock: add --rate HZ")
        if not set(POSITION) <= has and not self.given.get("position"):
            missing.append("a position: add px, py, pz to --columns, or --position 0,0,0 for a recording of attitudes")
        if not any(set(names) <= has for names in ATTITUDES):
            missing.append(
                "an attitude: add qx, qy, qz, qw (roll, pitch, yaw; rvx, rvy, rvz; r11 ... r33) to --columns"
            )
        lacking = [name for name in WRENCH if name not in has]
        if lacking and not self.elsewhere:
            missing.append(f"a wrench ({', '.join(lacking)}): add its columns, or its file with --wrench")
