"""The published results, by number, and what ours must reach. The modules of `rows` compute them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

from skillframe.extend.records import Lazy, RowType

OVERVIEW = "the overview paper (Suomalainen), section on learning from force"
TWO_ARMS = "Suomalainen, Calinon, Pignat, Kyrki, ICRA 2019"
SEARCH = "Ehlers, Suomalainen, Lundell, Kyrki, ICRA 2019 (abstract), and the overview paper"
PHASES = "Hagos, Suomalainen, Kyrki, IROS 2018 (abstract), and the overview paper"
CRANE = "HydraulicManipulatorVDC"

NOISE = {"teacher.aim_noise_deg": 8.0, "world.friction": 0.2}
INSERTION = {"robot.joint_friction": 0.5, "world.friction": 0.2, "lead_force_n": 30.0, "speed": 0.02}
SEARCHED = {
    "time": 20.0, "push": 10.0, "speed": 0.015, "stiffness": 2000.0, "world.fillet": 0.0008, "world.friction": 0.2,
}  # fmt: skip
MOVED = {**NOISE, "table.moved": 0.03}
BIASED = {"teacher.aim_noise_deg": 8.0, "teacher.bias_deg": 10.0}


def row_types() -> Iterable[RowType]:
    """All rows, by number."""
    subjects = (_learning_from_force(), _executed(), _two_arms(), _search(), _phases(), _whole_tasks(),
                _crane())  # fmt: skip
    return sorted(chain.from_iterable(subjects), key=lambda row: int(row.name))


def _learning_from_force() -> Iterable[RowType]:
    topic = "learning from force"
    yield RowType(
        name="1", topic=topic,
        summary="the sector of feasible pushes narrows with friction", published="narrower with friction",
        source=OVERVIEW, bar="median width within 1 degree of 90 - atan(friction), at three frictions",
        frozen=True, settings={"world.friction": 0.2, "teacher.aim_noise_deg": 3.0},
        run=Lazy("skillframe_papers.rows.lmc:sector_width"),
    )  # fmt: skip
    yield RowType(
        name="2", topic=topic,
        summary="from either side, one push and one free axis slide to the valley's bottom",
        published="slides from any start of the convergence region", source=OVERVIEW,
        bar="largest tilt of the push within 2 degrees of slope - atan(friction), both sides",
        frozen=True, settings={"world.friction": 0.2, "world.slope_deg": 45.0},
        run=Lazy("skillframe_papers.rows.lmc:valley_boundary"),
    )  # fmt: skip
    yield RowType(
        name="3", topic=topic,
        summary="the intersection of pyramids is robust to a wavering hand", published="robust to noise",
        source=OVERVIEW,
        bar="valley of uneven slopes and friction, turned at random, uneven starts, an aim that is off: a feasible "
        "direction in 90 % of 20 sets (by count), and by 95 % intervals more often than mean motion and straight down",
        settings=BIASED,
        run=Lazy("skillframe_papers.rows.uneven:noise"),
    )  # fmt: skip
    yield RowType(
        name="4", topic=topic,
        summary="hose coupler: a push, no turn; one compliant axis each; aligned from both starts",
        published="translation yes, rotation no; 1 + 1 axes; both starts aligned", source=OVERVIEW,
        bar="the same in 95 % of the pairs (by count), and both starts of every pair, steered at the flange, but not "
        "so if stiff in rotation",
        settings=NOISE,
        run=Lazy("skillframe_papers.rows.lmc:hose"),
    )  # fmt: skip
    yield RowType(
        name="5", topic=topic,
        summary="peg in hole: push along z, free along x, turns about y",
        published="push z, no turn, axes x and y", source=TWO_ARMS,
        bar="hole turned at random, uneven tilts, an aim that is off: identical, and the push within 10 degrees of the "
        "hole's axis, in 90 % of 20 sets (by count), the push by 95 % intervals more often right than straight down",
        settings={**BIASED, "world.friction": 0.2},
        run=Lazy("skillframe_papers.rows.uneven:peg"),
    )  # fmt: skip
    yield RowType(
        name="6", topic=topic,
        summary="levering teaches that translation is the environment's", published="3-DoF compliance",
        source=OVERVIEW, bar="translation fully compliant, rotation not, in every demonstration, and in none where the "
        "person pushes", settings=NOISE,
        run=Lazy("skillframe_papers.rows.lmc:levering"),
    )  # fmt: skip


def _executed() -> Iterable[RowType]:
    def row(name: str, summary: str, published: str, source: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=source, bar=bar, settings=NOISE, group="executed",
            topic="learning from force", run=Lazy(f"skillframe_papers.rows.skills:{run}"),
        )  # fmt: skip

    ahead = "in 90 % of the runs (by count), and by 95 % intervals more often than the same push"
    yield row("27", "one learned push works from any start of the convergence region",
              "from anywhere within the region", OVERVIEW,
              f"starts within 60 mm of the valley's bottom: it is reached {ahead} without compliance",
              "region")  # fmt: skip
    yield row("28", "a peg is learned, and inserted from varying starting orientation", "reproduced (Fig. 15)",
              OVERVIEW, f"tilts within 8 degrees, two demonstrations: inserted {ahead} with a stiff attitude",
              "peg")  # fmt: skip
    yield row("29", "one demonstration is enough", "one or more demonstrations", PHASES,
              f"tilts within 8 degrees, one demonstration: inserted {ahead} with a stiff attitude",
              "single")  # fmt: skip
    yield row("30", "rotation alone aligns a peg about its tip, and jams about the wrist", "tip aligns, wrist jams",
              TWO_ARMS, "both signs: up to 12 degrees about the tip, not even 4 about the wrist", "centre")  # fmt: skip
    yield RowType(
        name="34", topic="learning from force", summary="a screw motion: one phase pushes and turns, coupled by the "
        "pitch", published="speeds coupled by the pitch", source=OVERVIEW,
        bar="push, turn and pitch learned in 90 % of the sets, and a bayonet locked by a Panda in 90 % of the runs (by "
        "count), by 95 % intervals more often than by the same phase without its turn, and without its push",
        settings=NOISE, run=Lazy("skillframe_papers.rows.screws:screw"),
    )  # fmt: skip
    yield from _more_from_force()


def _more_from_force() -> Iterable[RowType]:
    def row(name: str, summary: str, published: str, source: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=source, bar=bar, settings=NOISE,
            topic="learning from force", run=Lazy(f"skillframe_papers.rows.{run}"),
        )  # fmt: skip

    yield row("36", "statics tell from which starts a learned push converges", "a convergence region of starts",
              OVERVIEW, "valleys tilted to within 10 degrees of what a push straight down bears: right about 90 % of "
              "the starts (by count), and by 95 % intervals more often than the region of a push straight down, than "
              "that all converge, and than that none does", "region:region")  # fmt: skip
    yield row("37", "one demonstration is enough for the valley and for the hose coupler", "one or more demonstrations",
              PHASES, "starts within 60 mm, tilts within 8 degrees, each world: reached from 90 % (by count), and by "
              "95 % intervals more often than by the same push, stiff", "alone:one")  # fmt: skip
    yield row("38", "several demonstrations are concatenated", "simply concatenated", OVERVIEW,
              "valley, peg and coupler, two demonstrations from anywhere on either side: as published from their "
              "concatenation in 90 % of 20 sets each (by count), and by 95 % intervals more often, all worlds "
              "together, than from the first alone", "concatenated:concatenated")  # fmt: skip
    yield row("39", "a skill is learned in several coordinate systems", "learned in different coordinate systems",
              OVERVIEW, "valley and peg, fixture and starts turned by 40 to 80 degrees: learned in the tool's axes, 90 "
              "% of the runs succeed (by count), by 95 % intervals more than learned in base axes; in place 90 % in "
              "either", "coordinates:frames")  # fmt: skip
    yield RowType(
        name="40", topic="learning from force", summary="a skill is learned without a wrench sensor",
        published="wrench estimated from what the controller commands", source=TWO_ARMS,
        bar="taught by teleoperation, valley with 0.5 Nm of friction in a Panda's joints, and hump: reached in 90 % of "
        "the runs each (by count), by 95 % intervals more often than without a wrench, and on the hump than along the "
        "mean motion (quick: the hump alone)",
        settings={"teacher.delay_s": 0.02, "robot.joint_friction": 0.5},
        run=Lazy("skillframe_papers.rows.sensorless:commanded"),
    )  # fmt: skip


def _two_arms() -> Iterable[RowType]:
    chosen = "largest push 30 N, on B and D with joint friction, + sign"

    def row(name: str, summary: str, published: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=TWO_ARMS, bar=bar, calibrated=chosen,
            settings=INSERTION, group="two arms", run=Lazy(f"skillframe_papers.rows.two_arms:{run}"),
        )  # fmt: skip

    yield row("7", "two arms insert up to a tilt that depends on who gives way where (Table I)",
              "A 4, B 12, C fails at 4, D 8, E 12 degrees",
              "with joint friction, + sign, fixture at 0.70, 0.75 and 0.80 m (quick: 0.75): each of A to E (quick: B "
              "to E) within 4 degrees (two steps) of the published", "table")  # fmt: skip
    yield row("8", "C fails because of static friction in the slave's joints", "C fails at 4 degrees",
              "C at 8 degrees, both signs: succeeds without joint friction and with the master's alone, fails with the "
              "slave's alone", "slave")  # fmt: skip
    yield row("9", "both arms compliant insert in shorter time (from 8 degrees)", "B 26.5 s, D 13.0 s, E 5.0 s",
              "with joint friction, + sign: E inserts in less time than D, and D in less than B", "times")  # fmt: skip
    yield row("10", "both arms compliant insert with less joint motion (from 8 degrees, Table II)",
              "B 1.45, D 0.99, E 0.59 rad; weighted by link length 1.18, 0.76, 0.51; largest joint 1.1, 0.47, 0.32",
              "with joint friction, + sign: E less than D, and D less than B, in all three lines", "paths")  # fmt: skip
    yield row("11", "the opposite sign of the tilt works as well", "works",
              "signs differ by at most 2 degrees for A to D: with joint friction in both postures and at 0.70, 0.75, "
              "0.80 m, without it in a sweep up to 24 degrees (quick: B to D with it, upright, at 0.75 m)",
              "signs")  # fmt: skip
    yield row("12", "the pair turns the wrong way only at large angles or low friction", "only there",
              "with joint friction, A to E (quick: B to E), both signs: never at up to 8 degrees and friction of the "
              "parts of 0.2 or more, and at least once at larger tilts or lower friction", "failures")  # fmt: skip
    yield row("24", "both arms compliant push less hard (from 8 degrees)", "lower forces, no figures",
              "with joint friction, + sign: E inserts with a smaller largest force than B", "forces")  # fmt: skip
    yield row("25", "the learned parameters do best", "learned parameters produce the best results",
              "with joint friction, + sign: E inserts from at least the largest tilt of A to D (quick: B to D)",
              "best")  # fmt: skip
    yield from _grasped(chosen)
    yield RowType(
        name="31", topic="two arms",
        summary="one teleoperated arm, the other standing still, teaches what both need",
        published="push z, no turn, axes x and y", source=TWO_ARMS,
        bar="identical, and the push within 10 degrees of z, in 90 % of 10 sets of two (by count), and by 95 % "
        "intervals more often than with a teleoperation that is 100 ms late",
        settings={"teacher.delay_s": 0.02, "teacher.late_s": 0.1, "world.friction": 0.2},
        run=Lazy("skillframe_papers.rows.one_arm:taught"),
    )  # fmt: skip


def _grasped(chosen: str) -> Iterable[RowType]:
    def row(name: str, summary: str, published: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, topic="two arms", summary=summary, published=published, source=TWO_ARMS, bar=bar,
            calibrated=f"{chosen}; and the tilt in the grasp, after tilts at the start had missed E",
            settings=INSERTION, group="two arms, grasped", run=Lazy(f"skillframe_papers.rows.grasped:{run}"),
        )  # fmt: skip

    yield row("43", "two arms insert up to a tilt in the grasp that depends on who gives way where (Table I)",
              "A 4, B 12, C fails at 4, D 8, E 12 degrees",
              "with joint friction, + sign, fixture at 0.70, 0.75 and 0.80 m (quick: 0.75, B and E): each of A "
              "to E within 4 degrees (one step) of the published", "table")  # fmt: skip
    yield row("44", "both arms compliant do best where the peg is tilted in the grasp",
              "less joint motion, shorter time, lower forces; the best results",
              "with joint friction, 0.75 m: E inserts from the largest tilt of all, both signs, and wherever another "
              "inserts, in less time, with less joint motion and a smaller largest force", "best")  # fmt: skip


def _search() -> Iterable[RowType]:
    chosen = "the budget of 20 s, against the published 85 % and 67 %"
    yield RowType(
        name="13", summary="learned search finds the hole (peg) and the socket", published="85 % peg, 67 % socket",
        source=SEARCH, bar="peg at least 75 %, socket at least 60 %, random walk at least 30 points below both (quick: "
        "the peg alone, in 5 s)",
        calibrated=chosen, settings=SEARCHED, group="search",
        run=Lazy("skillframe_papers.rows.search:found"),
    )  # fmt: skip
    yield RowType(
        name="14", summary="few blind demonstrations suffice", published="only few demonstrations", source=SEARCH,
        bar="hole 6 mm off in a direction that only demonstrations tell, 7 s: three of one person find at least 0.9 of "
        "what his ten find (by count, not quick), by 95 % intervals more than three of somebody who does not know",
        calibrated="the fillet of the part, and 6 mm and 7 s from row 23", settings=SEARCHED, group="search",
        run=Lazy("skillframe_papers.rows.few:few"),
    )  # fmt: skip
    yield RowType(
        name="23", summary="a spiral is sure with the right pitch and centre, in the plane only",
        published="guaranteed with the right pitch and start", source="the overview paper",
        bar="centred spiral 100 % of the peg's holes (not quick); centre 6 mm off: at 7 s, 15 points behind the "
        "learned search",
        calibrated="the fillet of the part, and the budgets of 20 s and 7 s", settings=SEARCHED,
        group="search",
        run=Lazy("skillframe_papers.rows.search:spiral"),
    )  # fmt: skip
    yield RowType(
        name="41", summary="a search that exerts the forces it was shown finds more on a soft arm",
        published="trajectory augmented with learned forces", source=SEARCH,
        bar="arm of 500 N/m, 13.4 s (quick: 5): at least 75 % of the peg's holes (by count), by 95 % intervals more "
        "than the same search with a constant push",
        calibrated="the fillet of the part, and the arm's 500 N/m, at which it had been seen", settings=SEARCHED,
        group="search", run=Lazy("skillframe_papers.rows.search:soft"),
    )  # fmt: skip
    yield RowType(
        name="42", summary="ergodic control finds the hole (peg) and the socket, too",
        published="two algorithms: sampling and ergodic control", source=SEARCH,
        bar="peg at least 75 %, socket at least 60 % (by count), by 95 % intervals more than the random walk (quick: "
        "the peg alone, in 5 s)",
        calibrated=chosen, settings=SEARCHED, group="search", run=Lazy("skillframe_papers.rows.search:ergodic"),
    )  # fmt: skip
    yield RowType(
        name="35", topic="search", summary="a learned search as exception strategy where a learned push stalls",
        published="search as exception strategy", source="the overview paper",
        bar="fixture 3 to 5 mm off: the push with the search on a stall inserts 90 % of the pegs (by count), by 95 % "
        "intervals more than the same skill without its search",
        settings={**NOISE, "world.fillet": 0.0008}, group="search",
        run=Lazy("skillframe_papers.rows.exceptions:exception"),
    )  # fmt: skip


def _phases() -> Iterable[RowType]:
    def row(name: str, summary: str, published: str, bar: str, run: str) -> RowType:
        return RowType(
            name=name, summary=summary, published=published, source=PHASES, bar=bar, settings=MOVED, group="phases",
            run=Lazy(f"skillframe_papers.rows.{run}"),
        )  # fmt: skip

    yield row("15", "hose coupler: two phases, lower and interlock", "two phases",
              "two phases and less than 5 % of the time mislabelled, in 90 % of the groups (by count), and by 95 % "
              "intervals more often than demonstrations cut in the middle", "phases:hose")  # fmt: skip
    yield row("16", "valley: both sides are one phase, along the valley is the second", "one phase, then a second",
              "two phases, both sides alike, the change within 0.3 s, in 90 % of the groups (by count), and by 95 % "
              "intervals more often than demonstrations cut in the middle", "phases:valley")  # fmt: skip
    yield row("17", "wrench-driven transitions do not mind where things stand", "less prone to position error",
              "tables 30 mm off, in every world: at least 90 % of changes within 0.3 s (by count), by 95 % intervals "
              "more than pose-driven transitions with the same densities and with the published softmax (quick: the "
              "corner)",
              "followed:moved")  # fmt: skip
    yield row("18", "the phase is recognised online by the forward algorithm", "online",
              "new demonstrations at another pace: 90 % of the policies without a mistake (every change within 0.3 s, "
              "no switch elsewhere), by 95 % intervals more than a clock (quick: the hose coupler)",
              "followed:online")  # fmt: skip
    yield row("26", "stops and force thresholds do not tolerate errors", "not error-tolerant",
              "in every world: the phase model finds at least 90 % of the changes within 0.3 s (by count), and by 95 % "
              "intervals more than stops, and stops with a threshold of 5 N", "plain_cuts:rules")  # fmt: skip


def _whole_tasks() -> Iterable[RowType]:
    bar = (
        "fixture off by up to {off}, three demonstrations: a Panda does the whole task in 90 % of the runs (by count), "
        "and by 95 % intervals more often than the same demonstrations learned as one phase, and than replays"
    )
    for name, summary, published, off, run in (
        ("32", "hose coupler: phases that were found are run by an arm", "reproduction was successful",
         "3 degrees and 5 mm", "coupler"),
        ("33", "box onto the table, then into the corner, run by an arm", "shown (Fig. 2b)", "10 mm either way",
         "corner"),
    ):  # fmt: skip
        yield RowType(
            name=name, topic="phases", summary=summary, published=published, source=PHASES, bar=bar.format(off=off),
            settings=NOISE, group=f"whole {run}", run=Lazy(f"skillframe_papers.rows.whole_tasks:{run}"),
        )  # fmt: skip


def _crane() -> Iterable[RowType]:
    yield RowType(
        name="19", topic="crane", summary="the crane learns and reproduces in contact, stiff and soft",
        published="demonstrated, no figures", source="IROS 2018 (abstract)",
        bar="from two teleoperated demonstrations on wood as on styrofoam: a push that slides on stack and "
        "stop, both pushes within 10 degrees, and every run on either ends in the corner with less than 12 kN (quick: "
        "taught on wood, run on styrofoam)",
        settings={"operator.angle_deg": -45.0, "operator.delay_s": 0.05, "world.friction": 0.3},
        run=Lazy("skillframe_papers.rows.crane_taught:taught"),
    )  # fmt: skip
    yield RowType(
        name="20", summary="contact force from chamber pressures while moving", published="4.1 % at 8000 N",
        source="Koivumäki and Mattila, T-RO 2015 (abstract)",
        bar="masses 10 % and friction 20 % off: largest error while sliding at most the published 4.1 % of the load",
        settings={"press.depth": 0.12, "duration": 14.0}, group="crane",
        run=Lazy("skillframe_papers.rows.crane:force"),
    )  # fmt: skip
    yield RowType(
        name="21", topic="crane", summary="pressures that hold the crane at its start",
        published="130/30.9 and 90/35.7 bar",
        source=f"{CRANE}, start values of the simulation", bar="net piston forces within 2 %", frozen=True,
        settings={"robot.payload": 475.0, "cylinder.bore": 0.080, "cylinder.rod": 0.045},
        run=Lazy("skillframe_papers.rows.crane:holding"),
    )  # fmt: skip
    yield RowType(
        name="22", summary="diamond path of 30 s with model errors of 10 % and friction errors of 20 %, and with the "
        "data set's own",
        published="no figure found", source=CRANE,
        bar="no trial stops, no error above 10 mm, which a tool that is 50 ms late exceeds",
        settings={"duration": 30.0}, group="crane",
        run=Lazy("skillframe_papers.rows.crane:diamond"),
    )  # fmt: skip
