"""The right answer of each of the 23 kinds that `outside_recordings` judges, as their README gives it."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.figures.outside_recordings import (
    Made,
    Refused,
    Score,
    Truth,
    as_proposed,
    converted,
    learned,
    proposed,
    says,
    told,
    typed,
)

Kind = Callable[[Made], list[Score]]


def each(judge: Callable[[Made, Path], tuple[bool, str]], kind: str) -> Kind:
    """A judge of single files for all files of its kind."""

    def judged(made: Made, path: Path) -> Score:
        try:
            return Score(path.name, *judge(made, path))
        except Refused as error:
            return Score(path.name, False, str(error))

    return lambda made: [judged(made, path) for path in made.files(kind)]


def read_as_proposed(made: Made, path: Path, truth: Truth, *options: object) -> tuple[bool, str]:
    """Whether the proposed line reads what was written. Axes of the wrench that are said to be open may be either."""
    found, answer = proposed(path, *options)
    if not found:
        return False, answer.text
    d = as_proposed(made, found)
    if isinstance(d, str):
        return False, d
    wrong = truth.differs(d, axes_open=bool(says(found["undecided"], "wrench|force", "axes")))
    return not wrong, wrong or found["line"].partition(path.name)[2].strip() or "as the header says"


def touches_once(audit: dict[str, Any], start: float, stop: float) -> str:
    """In what the contacts differ from one from start to stop [s]; "" where they are that."""
    found = audit.get("contacts", [])
    if len(found) == 1 and abs(found[0][0] - start) < 0.15 and abs(found[0][1] - stop) < 0.15:
        return ""
    return f"contacts {[[round(value, 2) for value in contact[:2]] for contact in found]}"


def repeated_stamps(made: Made, path: Path) -> tuple[bool, str]:
    right, said = read_as_proposed(made, path, made.slide(500))
    if not right:
        return right, said
    found, _ = proposed(path)
    words = shlex.split(found["line"])[1:]
    audit = typed(*words, "--json").document
    twice, shared = len(made.names["twice"]) - len(made.names["ts"]), len(made.names["k"])  # as make.py drew them
    notes = [says(audit["notes"], "twice", rf"\b{twice}\b"), says(audit["notes"], "stamp", rf"\b{shared}\b")]
    wrong = touches_once(audit, 3002.5, 3006.0) or f"{audit['rate_hz']:.4g} Hz" * (abs(audit["rate_hz"] - 500) > 10)
    typed("convert", *words[1:], "--out", made.folder / "spread.npz")
    skill = learned(made, made.folder / "spread.npz")
    return bool(not wrong and all(notes) and skill.slides), wrong or (
        skill.said if not skill.slides else "; ".join(notes)
    )


def wrench_first(made: Made, path: Path) -> tuple[bool, str]:
    found, answer = proposed(path, "--set", "rate=100")
    if doubt := says(told(found, "undecided", "missing"), "position|wrench|force", "column|assumed|first"):
        columns = found["settings"].get("columns", "")
        return not columns.startswith("px"), doubt
    return (
        read_as_proposed(made, path, made.slide(100, turn=10), "--set", "rate=100") if found else (False, answer.text)
    )


def wrench_axes(made: Made, path: Path) -> tuple[bool, str]:
    true = "base" if "_base_" in path.name else "tool"
    found, answer = proposed(path)
    if not found:
        return False, answer.text
    if doubt := says(found["undecided"], "wrench|force", "axes"):
        return "teacher" not in found["settings"].get("wrench_sign", ""), doubt
    frame, sign = found["settings"].get("wrench_frame"), found["settings"].get("wrench_sign", "environment")
    return (frame, sign) == (true, "environment"), says(found["because"], "axes") or found["line"]


def lets_go(made: Made, path: Path) -> tuple[bool, str]:
    audit, skill = typed("check", path, "--json").document, learned(made, path)
    faults = [fault for fault in audit["faults"] if fault["kind"] in ("jump", "saturation")]
    return not faults and skill.code == 0, str(faults or skill.said)


def resolution(made: Made, path: Path) -> tuple[bool, str]:
    right, said = lets_go(made, path)
    return (right, said) if not right else (learned(made, path).slides, said)


def longer_array(made: Made, path: Path) -> tuple[bool, str]:
    truth = made.slide(100)
    names = ["t=tlog[0]", *(f"p{a}=plog[{i}]" for i, a in enumerate("xyz"))]
    names += [f"q{a}=Qlog[{i}]" for i, a in enumerate("wxyz")]
    names += [f"{name}=f_log[{i}]" for i, name in enumerate(("fx", "fy", "fz", "tx", "ty", "tz"))]
    for clock in ("t=tlog[0]", "t=tlog"):
        d = converted(made, path, "--set", f"columns={','.join([clock, *names[1:]])}")
        wrong = d if isinstance(d, str) else truth.differs(d)
        if not wrong:
            return read_as_proposed(made, path, truth)
    return False, wrong


def cell_of_structs(made: Made, path: Path) -> tuple[bool, str]:
    found, answer = proposed(path)
    if not found and "--set episode" in answer.text:
        return read_as_proposed(made, path, made.slide(100), "--set", "episode=0")
    return read_as_proposed(made, path, made.slide(100))


def two_objects(made: Made, path: Path) -> tuple[bool, str]:
    found, answer = proposed(path)
    picks = dict(pick.split("=") for pick in found.get("settings", {}).get("columns", "").split(",") if "=" in pick)
    header = path.read_text().splitlines()[0].split(",")
    named = {k: header[int(v) - 1] if v.isdigit() else v for k, v in picks.items()}
    bodies = {body for name in named.values() for body in ("Left", "Right") if body in name}
    whole = {"px", "py", "pz", "roll", "pitch", "yaw", "fx", "fy", "fz", "tx", "ty", "tz"} <= picks.keys()
    other = {"Left", "Right"} - bodies
    named_other = says(told(found, "because", "undecided", "missing"), *other)
    said = f"{' and '.join(sorted(bodies))}, {len(picks)} columns; {named_other or answer.err}"
    return whole and len(bodies) == 1 and bool(named_other), said


def seconds(made: Made, path: Path) -> tuple[bool, str]:
    truth = made.slide(10)
    return read_as_proposed(made, path, truth._replace(time=truth.time * 10))


def scalar_first(made: Made, path: Path) -> tuple[bool, str]:
    found, answer = proposed(path)
    if said := says(told(found, "because", "undecided"), "quaternion", "as the header says"):
        return False, said
    doubt = says(found.get("undecided", []), "quaternion|q0")
    right, said = read_as_proposed(made, path, made.slide(100))
    return right or bool(doubt), doubt or said or answer.text


def no_quaternion(made: Made, path: Path) -> tuple[bool, str]:
    answer = typed("check", path, "--json")
    said = says(answer.document.get("warnings", ["refused"]), "quaternion|w-first")
    return answer.code == 0 and not said, said or answer.err or "no word of quaternions"


def touched(made: Made, path: Path) -> tuple[bool, str]:
    audit = typed("check", path, "--json").document
    late, said = audit["wrench_late_s"], says(audit["warnings"], "clocks")
    return not said and (late is None or abs(late) < 0.05), said or f"lateness {late}"


def other_sign(made: Made, path: Path) -> tuple[bool, str]:
    layout, out = made.folder / "layout.toml", made.folder / "calibration.json"
    words = ("calibrate", path, "--layout", layout, "--out", out)
    layout.write_text('rate = 1\nposition = "0,0,0"\n')
    first = typed(*words)
    layout.write_text('rate = 1\nposition = "0,0,0"\nwrench-sign = "teacher"\n')
    typed(*words)
    then = json.loads(out.read_text())
    near = (
        abs(then["mass_kg"] - 0.8) < 0.02
        and np.abs(np.subtract(then["com_m"], [0, 0, 0.06])).max() < 3e-3
        and np.abs(np.subtract(then["bias"][:3], [-1.2, 0.7, -2.1])).max() < 0.05
    )
    return first.code == 2 and "wrench-sign" in first.text and near, first.text


def tared(made: Made, path: Path) -> tuple[bool, str]:
    warnings = typed("check", path, "--set", "wrench-frame=tool", "--json").document["warnings"]
    if (false := says(warnings, "w-first")) or not says(warnings, r"0\.7\d kg|0\.8\d? kg"):
        return False, false or "no word of the weight"
    found, _ = proposed(path)
    frame, sign = (found["settings"].get(f"wrench_{name}") for name in ("frame", "sign"))
    if doubt := says(found["undecided"], "wrench|force", "axes"):
        return sign != "teacher" and bool(says(told(found, "because", "undecided"), "weight")), doubt
    return (frame, sign) == ("tool", "environment"), found["line"]


def matrices(made: Made, path: Path) -> tuple[bool, str]:
    return read_as_proposed(made, path, made.slide(100))


def short_pose(made: Made, path: Path) -> tuple[bool, str]:
    wrench = path.with_name("16_wrench.csv")
    answer = typed("convert", path, "--set", f"wrench={wrench}", "--out", made.folder / "joined.npz")
    said = says(answer.err.splitlines(), "left out|dropped|not used", "wrench")
    out = [float(number) for number in re.findall(r"\d+\.?\d*", said)]
    return answer.code == 0 and any(abs(number - 58.5) < 0.3 for number in out), said or answer.text


def force_alone(made: Made, path: Path) -> tuple[bool, str]:
    answer = typed("check", path, "--json")
    if answer.code == 2:
        return "torque" in answer.err and "--" in answer.err, answer.err
    said = says(told(answer.document, "notes", "warnings"), "torque")
    skill = learned(made, path)
    wrong = touches_once(answer.document, 2.5, 6.0)
    return bool(said and skill.slides and not wrong), wrong or (said if skill.slides else skill.said)


def nothing_moves(made: Made, path: Path) -> tuple[bool, str]:
    skill = learned(made, path)
    return "next: good" not in skill.said and "record" in skill.said, skill.said


def pushed_aside(made: Made) -> list[Score]:
    scores, turned = [], []
    for path in made.files("19"):
        out = made.folder / f"turned_{path.stem}.npz"
        said = typed("convert", path, "--set", "wrench-sign=teacher", "--out", out).err
        skill, plain = learned(made, out), learned(made, path)
        late = [line for line in said.splitlines() if "clocks:" in line]
        fine = (skill.off([0, 0, -1]) <= 10.0 or not skill.sure) and "next: good" not in plain.said and not late
        scores.append(
            Score(path.name, fine, "; ".join(late) or f"{skill.off([0, 0, -1]):.0f} degrees off; {skill.said}")
        )
        turned.append(out)
    pool = learned(made, *turned)
    right = pool.off([0, 0, -1]) <= 10.0 or not pool.sure
    return [*scores, Score("all four", right, f"{pool.off([0, 0, -1]):.0f} degrees off; {pool.said}")]


def three_lines(made: Made, path: Path) -> tuple[bool, str]:
    return read_as_proposed(made, path, made.slide(100))


def vibration(made: Made, path: Path) -> tuple[bool, str]:
    cleaned = made.folder / "cleaned.npz"
    audit = typed("check", path, "--json").document
    typed("filter", path, "--out", cleaned)
    after = typed("check", cleaned, "--json").document
    found = [audit["contacts"], after["contacts"]]
    said = says(audit["warnings"], "vibrat")
    length = [sum(contact[1] - contact[0] for contact in contacts) for contacts in found] if said else [0.0, 0.0]
    return not any(found) or bool(said and length[1] <= length[0]), said or f"contacts {found}"


def no_stamps(made: Made, path: Path) -> tuple[bool, str]:
    truth = made.slide(100)
    for more in ((), ("--set", "rate=100"), ("--set", "rate=100", "--set", "wrench-rate=100")):
        d = converted(made, path, "--set", "wrench-frame=tool", *more)
        if not isinstance(d, str):
            return not (wrong := truth.differs(d)), wrong or f"read{' with ' * bool(more)}{' '.join(map(str, more))}"
        if "--set wrench-shift" in d or (more and "--set wrench-rate" not in d):
            return False, d
    return False, str(d)


def repeated_messages(made: Made, path: Path) -> tuple[bool, str]:
    answer = typed("check", path, "--set", "wrench-frame=tool", "--json")
    d = converted(made, path, "--set", "wrench-frame=tool")
    if isinstance(d, str):
        return False, d
    note = says(answer.document["notes"], r"\b15\b")
    wrong = made.slide(100).differs(d) or touches_once(answer.document, 2.5, 6.0)
    return bool(note and not wrong), wrong or note or "no note"


KINDS: dict[str, Kind] = {
    "01": each(repeated_stamps, "01"), "02": each(wrench_first, "02"), "03": each(wrench_axes, "03"),
    "04": each(lets_go, "04"), "05": each(resolution, "05"), "06": each(longer_array, "06"),
    "07": each(cell_of_structs, "07"), "08": each(two_objects, "08"), "09": each(seconds, "09"),
    "10": each(scalar_first, "10"), "11": each(no_quaternion, "11"), "12": each(touched, "12"),
    "13": each(other_sign, "13"), "14": each(tared, "14"), "15": each(matrices, "15"),
    "16": each(short_pose, "16_pose"), "17": each(force_alone, "17"), "18": each(nothing_moves, "18"),
    "19": pushed_aside, "20": each(three_lines, "20"), "21": each(vibration, "21"), "22": each(no_stamps, "22"),
    "23": each(repeated_messages, "23"),
}  # fmt: skip
