"""Rows 7 to 12, 24 and 25: Tables I and II of the two-arm paper, and its statements about them.

All rows read one sweep (`sweep`). A *null* has the same threshold without the cause that the paper names, and is
printed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skillframe.extend import Illustration, RowResult, RowRun
from skillframe_papers.rows.insertion import MOTION, PUBLISHED, Arms, Row
from skillframe_papers.rows.sweep import HEIGHTS_M, Sweep, stuck_in, sweep

WRONG = ("common rotation", "turned away")
SLAVE = "the slave's alone"
SMALL_DEG, ROUGH = 8.0, 0.2
"""Up to this tilt and from this friction of the parts on, no pair turns the wrong way (a reading of the paper)."""


def table(job: RowRun) -> RowResult:
    """Row 7: Table I, at every height of the fixture."""
    found = sweep(job)
    names, heights = found.names, found.heights_run
    reach = {h: {n: found.reach_at(n, 1, h) for n in names[:5]} for h in heights}
    unlike = {h: _unlike(reach[h]) for h in heights}
    free = _unlike({n: found.reach(n, 1, stuck=False) for n in names[:5]})
    columns = [(False, "upright"), *((True, posture) for posture in found.postures)]
    head = ["largest tilt [degrees]", "published"]
    head += [f"{found.stiff if stuck else 0:g} Nm, {posture}, + / -" for stuck, posture in columns]
    head += [f"{found.stiff:g} Nm, fixture at {h:.2f} m, + / -" for h in heights if h != HEIGHTS_M[1]]
    rows = [
        [n, _number(PUBLISHED.get(n, {}).get("largest_deg")),
         *(_both(found, n, posture, stuck) for stuck, posture in columns), *_at_heights(found, n)]
        for n in names
    ]  # fmt: skip
    own = reach[HEIGHTS_M[1]]
    return RowResult(
        ours=", ".join(f"{n} {own[n]:g}" for n in own) + f" degrees at {found.stiff:g} Nm, + sign, {HEIGHTS_M[1]} m; "
        "not as published: " + ", ".join(f"{' and '.join(unlike[h]) or 'none'} at {h:.2f} m" for h in heights),
        verdict="fail" if any(unlike.values()) else "pass", head=head, rows=rows, pictures=[_picture(found)],
        values={f"largest_{n}_deg": own[n] for n in own},
        difference=f"Null: without joint friction {' and '.join(free) or 'none'} are off.{_held(found)}",
    )  # fmt: skip


def _unlike(reach: dict[str, float]) -> list[str]:
    published = {n: PUBLISHED[n]["largest_deg"] for n in PUBLISHED if n in reach}
    # The quick sweep's step, and the tolerance of C, which fails at the paper's first tilt
    return [n for n, value in published.items() if abs(reach[n] - value) > 4.0]


def _held(found: Sweep) -> str:
    """Effect of holding the pair: E beside E*."""
    if "E*" not in found.names:
        return ""
    stuck = {n: found.of(n, stuck=True) for n in ("E", "E*")}
    told = {n: f"{sum(r.outcome in WRONG for r in each)} of {len(each)}" for n, each in stuck.items()}
    return (
        " Both arms of E are free along x and about y, so that nothing holds the pair: with joint friction it turns "
        f"the wrong way in {told['E']} insertions, and in {told['E*']} if it is held (E*, ours)."
    )


def _at_heights(found: Sweep, name: str) -> list[str]:
    others = [h for h in found.heights_run if h != HEIGHTS_M[1]]
    if (name, HEIGHTS_M[1]) not in found.heights:
        return ["-"] * len(others)
    return [" / ".join(f"{found.reach_at(name, sign, h):g}" for sign in (1, -1)) for h in others]


def _both(found: Sweep, name: str, posture: str, stuck: bool) -> str:
    if (name, posture) not in found.rows:
        return "-"
    return " / ".join(f"{found.reach(name, sign, posture, stuck=stuck):g}" for sign in (1, -1))


def _number(value: float | None, unit: str = "") -> str:
    return "-" if value is None else f"{value:g}{unit}"


def slave(job: RowRun) -> RowResult:
    """Row 8: configuration C with joint friction in one arm, in the other, in both and in none."""
    found, key = sweep(job), tuple(sorted(job.settings.items()))
    cases = {
        "none": found.of("C", stuck=False), "the master's alone (the null)": stuck_in(key, job.seed, 0, job.quick),
        SLAVE: stuck_in(key, job.seed, 1, job.quick), "both": found.of("C", stuck=True),
    }  # fmt: skip
    tilts = (8.0, -8.0) if job.quick else (4.0, -4.0, 8.0, -8.0)
    ends = {where: [_ended(rows, tilt) for tilt in tilts] for where, rows in cases.items()}
    worked = {where: [text.startswith("success") for text in each] for where, each in ends.items()}
    none, master, slave, _ = (each[-2:] for each in worked.values())
    good = all(none) and all(master) and not any(slave)
    return RowResult(
        ours=f"C from 8 degrees, signs that insert: {sum(none)} of 2 without joint friction, {sum(master)} with the "
        f"master's alone, {sum(slave)} with the slave's alone"
        + ("" if job.quick else f"; from 4 degrees with the slave's: {sum(worked[SLAVE][:2])} of 2")
        + "; each tilt and sign is run once",
        verdict="pass" if good else "fail", head=("joint friction in", *(f"{tilt:+g} degrees" for tilt in tilts)),
        rows=[(where, *each) for where, each in ends.items()],
        difference=f"Null: the same friction in the master's joints, where the threshold has "
        f"{sum(not w for w in master)} of 2 fail. The paper has C fail at 4 degrees, too.",
    )  # fmt: skip


def _ended(rows: Sequence[Row], tilt: float) -> str:
    row = next(r for r in rows if r.tilt_deg == tilt)
    return f"success, {row.time_s:.1f} s" if row.outcome == "success" else row.outcome


def _at_8(found: Sweep, name: str, stuck: bool, sign: float = 1.0) -> Row:
    return next(r for r in found.of(name, stuck=stuck) if r.tilt_deg == sign * 8.0)


Measure = Callable[[Row], float]


def _ordered(found: Sweep, measure: Measure, *, stuck: bool) -> bool:
    """Whether E is below D, and D below B, at +8 degrees, failures above everything."""
    e, d, b = (measure(r) if (r := _at_8(found, n, stuck)).outcome == "success" else np.inf for n in ("E", "D", "B"))
    return e < d < b


def _words(holds: bool) -> str:
    return "holds" if holds else "does not hold"


def _columns(found: Sweep) -> list[tuple[bool, float]]:
    return [(stuck, sign) for stuck in (False, True) for sign in (1.0, -1.0)]


def _heads(found: Sweep) -> list[str]:
    return [f"{found.stiff if s else 0:g} Nm, {'+' if sign > 0 else '-'}" for s, sign in _columns(found)]


def times(job: RowRun) -> RowResult:
    """Row 9: times to insert from 8 degrees."""
    found = sweep(job)

    def text(row: Row) -> str:
        return f"{row.time_s:.1f} s" if row.outcome == "success" else row.outcome

    rows = [
        [n, _number(PUBLISHED.get(n, {}).get("time_s"), " s"),
         *(text(_at_8(found, n, s, sign)) for s, sign in _columns(found))]
        for n in found.names
    ]  # fmt: skip
    stuck, free = (_ordered(found, lambda r: r.time_s, stuck=s) for s in (True, False))
    return RowResult(
        ours=", ".join(f"{n}: {text(_at_8(found, n, True))}" for n in "BDE") + " with joint friction",
        verdict="pass" if stuck else "fail", rows=rows, head=("", "published", *_heads(found)),
        difference=f"Null: without joint friction E < D < B {_words(free)}. Times depend on the speed, which is ours "
        f"({1e3 * job.settings['speed']:g} mm/s); the paper's is not given. They end at the goal, by the simulator.",
        values={f"{n}_{'stuck' if s else 'free'}": _at_8(found, n, s).time_s for n in found.names
                for s in (False, True)},
    )  # fmt: skip


LINES: dict[str, tuple[int, Callable[[Row], Arms]]] = {
    "way of all joints": (0, lambda r: r.joint_path_rad),
    "weighted by link length": (1, lambda r: r.weighted_rad),
    "largest way of a joint": (2, lambda r: r.largest_joint_rad),
}
"""Lines of Table II: their place in `MOTION`, and the computed value by arm."""


def paths(job: RowRun) -> RowResult:
    """Row 10: joint motion from 8 degrees, all three lines of Table II."""
    found = sweep(job)
    rows, holds = [], {}

    def text(row: Row) -> str:
        return f"{sum(row.joint_path_rad):.2f} rad" if row.outcome == "success" else row.outcome

    for line, (place, of) in LINES.items():
        holds[line] = [_ordered(found, _whole(place, of), stuck=s) for s in (True, False)]
        for n in found.names:
            published = _pair(MOTION[n][place]) if n in MOTION else "-"
            cells = [_at_8(found, n, s, sign) for s, sign in _columns(found)]
            rows.append([line, n, published, *(_pair(of(r)) if r.outcome == "success" else r.outcome for r in cells)])
    stuck, free = (sum(each[i] for each in holds.values()) for i in (0, 1))
    own = {n: _at_8(found, n, True) for n in "BDE"}
    return RowResult(
        ours=", ".join(f"{n}: {text(r)}" for n, r in own.items())
        + f" with joint friction; E < D < B in {stuck} of {len(holds)} lines",
        verdict="pass" if stuck == len(holds) else "fail", rows=rows,
        head=("master, slave [rad]", "", "published", *_heads(found)),
        difference=f"Null: without joint friction the order holds in {free} of {len(holds)} lines. Postures and speed "
        "are ours. A joint's weight is the length of the chain from it to the flange over that of the whole chain, our "
        "reading of the paper's words.",
        values={f"{n}_{'stuck' if s else 'free'}": sum(_at_8(found, n, s).joint_path_rad) for n in found.names
                for s in (False, True)},
    )  # fmt: skip


def _whole(place: int, of: Callable[[Row], Arms]) -> Measure:
    """Of both arms: the larger one for the last line, else their sum."""
    return (lambda row: max(of(row))) if place == 2 else (lambda row: sum(of(row)))


def _pair(arms: Arms) -> str:
    return f"{arms[0]:.2f}, {arms[1]:.2f}"


def signs(job: RowRun) -> RowResult:
    """Row 11: largest tilts of both signs, beyond the sweep's end where possible."""
    found = sweep(job)
    names, held = found.names[:5], [n for n in found.names[:5] if n != "E"]
    reaches = {f"{found.stiff:g} Nm, {p}": _signed(found, p) for p in found.postures}
    reaches |= {
        f"{found.stiff:g} Nm, fixture at {h:.2f} m": {
            n: (found.reach_at(n, 1, h), found.reach_at(n, -1, h)) for n in names
        }
        for h in found.heights_run
        if h != HEIGHTS_M[1]
    }
    free = {n: (found.reach_free(n, 1), found.reach_free(n, -1)) for n in names} if found.beyond else {}
    if free:
        reaches["0 Nm, upright"] = free
    worst = {n: max(abs(each[n][0] - each[n][1]) for each in reaches.values()) for n in names}
    rows = [
        [n, *(f"{c[n][0]:g} / {c[n][1]:g}" if n in c else "-" for c in reaches.values())] for n in found.names
    ]  # fmt: skip
    top = max((abs(r.tilt_deg) for each in found.beyond.values() for r in each), default=0.0)
    ends = [n for n, each in free.items() if min(each) >= top]
    return RowResult(
        ours="signs differ by " + ", ".join(f"{n} {worst[n]:g}" for n in held) + " degrees at most",
        verdict="pass" if max(worst[n] for n in held) <= 2.0 else "fail", rows=rows,  # one step of the sweep
        head=["largest tilt, + / - [degrees]", *reaches],
        difference=f"Null: E, both arms of which are free, so that nothing holds the pair: by {worst['E']:g} degrees."
        + (f" Without joint friction the sweep ends at {top:g} degrees, where {' and '.join(ends)} do not differ."
           if ends else ""),
        values={f"apart_{n}_deg": worst[n] for n in worst},
    )  # fmt: skip


def _signed(found: Sweep, posture: str) -> dict[str, tuple[float, float]]:
    names = [n for n in found.names if (n, posture) in found.rows]
    return {n: (found.reach(n, 1, posture, stuck=True), found.reach(n, -1, posture, stuck=True)) for n in names}


def failures(job: RowRun) -> RowResult:
    """Row 12: at which tilts and frictions of the parts pairs turn the wrong way."""
    found = sweep(job)
    frictions, names = sorted({f for _, f in found.parts}), found.names[:5]
    tilts = sorted({abs(r.tilt_deg) for each in found.parts.values() for r in each})
    rows, early, late = [], 0, 0
    for friction in frictions:
        for tilt in tilts:
            cells = {n: [r for r in found.parts[n, friction] if abs(r.tilt_deg) == tilt] for n in names}
            wrong = {n: sum(r.outcome in WRONG for r in each) for n, each in cells.items()}
            rows.append([f"{friction:g}", f"{tilt:g}", *(f"{wrong[n]} of {len(cells[n])}" for n in names)])
            if tilt <= SMALL_DEG and friction >= ROUGH:
                early += sum(wrong.values())
            else:
                late += sum(wrong.values())
    never = [n for n in names if not any(r.outcome in WRONG for f in frictions for r in found.parts[n, f])]
    return RowResult(
        ours=f"{early} pairs turn the wrong way at up to {SMALL_DEG:g} degrees and friction of the parts of {ROUGH:g} "
        f"or more, {late} at larger tilts or lower friction",
        verdict="pass" if early == 0 and late > 0 else "fail", rows=rows,
        head=("friction of the parts", "tilt [degrees]", *(f"{n} turns the wrong way" for n in names)),
        difference=f"Null: {', '.join(never) or 'none'} never turn the wrong way, and alone would miss the second half "
        "of the threshold. With joint friction, both signs.",
        values={"early": float(early), "late": float(late)},
    )  # fmt: skip


def forces(job: RowRun) -> RowResult:
    """Row 24: contact forces from 8 degrees, to the goal and on to the bottom."""
    found = sweep(job)

    def text(row: Row) -> str:
        return f"{row.force_n:.0f} N" + ("" if row.outcome == "success" else f", {row.outcome}")

    rows, ends = [], [f"on to the bottom, {head}" for head in _heads(found)[2:]] if found.bottom else []
    for n in found.names:
        cells = [_at_8(found, n, s, sign) for s, sign in _columns(found)]
        onward = [text(r) for r in found.bottom.get(n, [])] or ["-"] * len(ends)
        rows.append([n, *(text(r) for r in cells), *onward])
    stuck, free = ({n: _at_8(found, n, s) for n in "BE"} for s in (True, False))
    good = stuck["E"].outcome == "success" and stuck["E"].force_n < stuck["B"].force_n
    after = [r.force_n for n in "ABD" for r in found.bottom.get(n, [])]
    return RowResult(
        ours=f"to the goal with joint friction: B {text(stuck['B'])}, E {text(stuck['E'])}"
        + (f"; run on to the bottom, A, B and D peak at {min(after):.0f} to {max(after):.0f} N" if after else ""),
        verdict="pass" if good else "fail", head=("", *(f"to the goal, {head}" for head in _heads(found)), *ends),
        rows=rows,
        difference=f"Null: without joint friction, where E reaches {free['E'].force_n:.0f} N and B "
        f"{free['B'].force_n:.0f} N. The paper gives no figures. A pair that comes free under the push of "
        f"{job.settings['lead_force_n']:g} N hits the bottom after the goal, where nobody catches it.",
    )  # fmt: skip


def best(job: RowRun) -> RowResult:
    """Row 25: whether the learned parameters, E's, insert from the largest tilt."""
    found = sweep(job)
    stuck = {n: found.reach(n, 1, stuck=True) for n in found.names[:5]}
    free = {n: found.reach_free(n, 1) for n in found.names[:5]}
    others = max(value for n, value in stuck.items() if n != "E")
    return RowResult(
        ours=f"E, which is what is learned, {stuck['E']:g} degrees; the best of the others {others:g}",
        verdict="pass" if stuck["E"] >= others else "fail",
        head=("", "published [degrees]", f"{found.stiff:g} Nm, + [degrees]", "0 Nm, + [degrees]"),
        rows=[(n, _number(PUBLISHED[n]["largest_deg"]), f"{stuck[n]:g}", f"{free[n]:g}") for n in stuck],
        difference="Null: each of the others in E's place, of which "
        f"{' and '.join(n for n in stuck if n != 'E' and stuck[n] < max(stuck.values())) or 'none'} "
        "miss the threshold.",
        values={"learned_deg": stuck["E"], "others_deg": others},
    )  # fmt: skip


def _picture(found: Sweep) -> Illustration:
    """Table I as bars: published, and computed with and without joint friction."""
    from matplotlib.figure import Figure
    from skillframe_segmenter.drawing import BLUE, GREY, INK, RED, svg

    figure = Figure(figsize=(7.0, 3.8))
    canvas = figure.add_subplot()
    place = np.arange(len(found.names), dtype=float)
    bars = (
        ("published", INK, [PUBLISHED.get(n, {}).get("largest_deg", np.nan) for n in found.names]),
        (f"ours, {found.stiff:g} Nm, +", RED, [found.reach(n, 1, stuck=True) for n in found.names]),
        (f"ours, {found.stiff:g} Nm, -", BLUE, [found.reach(n, -1, stuck=True) for n in found.names]),
        ("ours, no joint friction, +", GREY, [found.reach(n, 1, stuck=False) for n in found.names]),
    )
    for i, (label, colour, heights) in enumerate(bars):
        drawn = canvas.bar(place + 0.2 * (i - 1.5), heights, width=0.19, color=colour, label=label)
        canvas.bar_label(drawn, fmt="%g", padding=1, fontsize=8)
    canvas.set_xticks(place, found.names)
    canvas.set_ylabel("largest tilt [degrees]")
    canvas.margins(y=0.12)
    canvas.legend(ncols=2, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=9)
    ours = " E* is ours: E as a relative task." if "E*" in found.names else ""
    caption = (
        "Largest tilt up to which every insertion succeeds; 0 fails at the smallest, and the sweep ends at "
        f"{max(abs(r.tilt_deg) for r in found.of('B', stuck=True)):g} degrees, without joint friction at "
        f"{max(abs(r.tilt_deg) for r in found.of('B', stuck=False)):g}.{ours}"
    )
    return Illustration("Table I of the two-arm paper", caption, svg(figure))
