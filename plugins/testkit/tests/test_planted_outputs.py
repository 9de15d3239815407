"""Exporters, scores, robots, drives and sections with one defect each: the kit names all, and passes sound ones."""

import dataclasses
import json
import random
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from skillframe_testkit.checks import check_exporter, check_robot, check_score, check_section

from skillframe.errors import InputError
from skillframe.execution.trace import Trace
from skillframe.extend import (
    ExporterType,
    Grid,
    Illustration,
    RobotType,
    ScoreType,
    SectionType,
)  # fmt: skip
from skillframe.extend.registry import registry
from skillframe.robot import load_robot

# -- exporters


def gains(phase, lines):
    head = "".join(f"# {line}\n" for line in lines)
    return head + json.dumps({"stiffness": np.diag(phase.stiffness).tolist(), "twist": phase.twist.tolist()})


def exporter(write=gains, **changes):
    given = {"name": "mine", "summary": "an example", "axes": "base", "checked": "maker/controller 1.2", "write": write}
    return ExporterType(**{**given, **changes})


def divides(phase, lines):
    with np.errstate(divide="ignore", invalid="ignore"):
        return gains(phase, lines) + f"\nclip: {(phase.lead_force / np.diag(phase.stiffness)).tolist()}"


def counts(phase, lines, kept=[0]):  # noqa: B006 - it is to differ from call to call
    kept[0] += 1
    return gains(phase, lines) + f"\nid: {kept[0]}"


def overwrites(phase, lines):
    phase.stiffness[0, 0] = 1.0
    return gains(phase, lines)


def saves(phase, lines):
    Path("settings.yaml").write_text("x")
    return gains(phase, lines)


def refuses(phase, lines):
    raise InputError("skill", "cannot be held", "learn another one")


def crashes(phase, lines):
    return gains(phase, lines) if phase.twist.any() else {}["speed"]


def shouts(phase, lines):
    print("exporting")
    return gains(phase, lines)


BAD_EXPORTERS = {
    "writes infinities": (exporter(divides), "writes: writes 'inf' for a push that is free along x"),
    "writes NaN": (exporter(lambda p, i: gains(p, i) + "\nmass: .nan"), "writes 'nan'|writes '.nan'"),
    "depends on call order": (exporter(counts), "repeats: writes another text for the same phase"),
    "ignores the skill": (exporter(lambda p, i: "\n".join(i)), "the settings stay the same whatever the phase's"),
    "changes the phase": (exporter(overwrites), "raised ValueError: assignment destination is read-only"),
    "writes a file of its own": (exporter(saves), "opens the file 'settings.yaml' for writing"),
    "prints": (exporter(shouts), "prints 'exporting'"),
    "raises": (exporter(crashes), "writes: raised KeyError: 'speed'"),
    "refuses everything": (exporter(refuses), "refuses every example"),
    "gives no text": (exporter(lambda p, i: {"stiffness": 1.0}), "give the text of a file"),
    "says not what it was checked against": (exporter(checked=""), "checked is empty"),
    "has unknown axes": (exporter(axes="world"), "axes is 'world'; give 'base' or 'tool'"),
    "has a text as notes": (exporter(notes="one"), "give a tuple of lines"),
}


@pytest.mark.parametrize("how", BAD_EXPORTERS)
def test_an_exporter_with_a_defect_is_named(how, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record, said = BAD_EXPORTERS[how]
    problems = "\n".join(check_exporter(record))
    assert any(text in problems for text in said.split("|")), problems


@pytest.mark.parametrize("axes", ["base", "tool"])
def test_a_sound_exporter_passes(axes):
    assert check_exporter(exporter(axes=axes)) == []


def test_of_a_program_only_the_record_is_checked():
    assert check_exporter(exporter(lambda document, robot, lines: 1 / 0, axes=None)) == []
    assert "checked is empty" in "\n".join(check_exporter(exporter(axes=None, checked="")))


def test_an_exporter_may_refuse_what_its_controller_cannot_hold():
    def picky(phase, lines):
        if not np.any(phase.stiffness) or np.any(phase.stiffness[0, 1:]):
            raise InputError("skill", "is limp or slanted", "learn another one")
        return gains(phase, lines)

    assert check_exporter(exporter(picky)) == []


# -- scores


def score(compute, **changes):
    given = {"name": "way", "summary": "an example", "unit": "m", "compute": compute}
    return ScoreType(**{**given, **changes})


def way(trace):
    return float(np.nansum(np.linalg.norm(np.diff(trace.position, axis=0), axis=1)))


def settling(trace):
    """Only a success settles."""
    return trace.time[-1] if trace.meta["success"] else float("nan")


def ordered(trace, kept=[]):  # noqa: B006 - see `counts`
    kept.append(trace.time[-1])
    return float(np.mean(kept))


def labels(trace):
    trace.meta["label"] = "seen"
    return 1.0


def sleepy(trace):
    end = time.process_time() + (0.7 if len(trace.time) > 1000 else 0.0)
    while time.process_time() < end:
        pass
    return 1.0


BAD_SCORES = {
    "is infinite": (score(lambda t: 1.0 / max(t.time[-1] - 4.0, 0.0) if t.time[-1] != 4.0 else np.inf), "gave inf"),
    "is nan for a plain run": (score(lambda t: np.nan), "a success: gives nan"),
    "depends on call order": (score(ordered), "repeats: gives"),
    "draws by chance": (score(lambda t: random.random()), "repeats: gives"),
    "fails on a short trial": (score(lambda t: float(np.diff(t.time).min())), "of one sample: raised ValueError"),
    "trips over a diverged trial": (score(lambda t: int(way(t)) + int(t.position[-1, 0])), "that diverged: raised"),
    "writes into the trace": (score(lambda t: t.position.fill(0.0) or 1.0), "read-only"),
    "labels the trace": (score(labels), "changes the trace's metadata"),
    "gives an array": (score(lambda t: t.wrench[:, 0]), "not a number"),
    "gives a truth value": (score(lambda t: True), "gave True, not a number"),
    "is slow": (score(sleepy), "of processor time for a run of 20 s"),
    "prints": (score(lambda t: print("scoring") or 1.0), "prints 'scoring'"),
    "has no unit": (score(way, unit=""), "unit is ''"),
    "cannot name a column": (score(way, name="way [m]"), "use letters, digits and underscores"),
}  # fmt: skip


@pytest.mark.parametrize("how", BAD_SCORES)
@pytest.mark.slow
def test_a_score_with_a_defect_is_named(how):
    record, said = BAD_SCORES[how]
    problems = "\n".join(check_score(record))
    assert said in problems, problems


@pytest.mark.parametrize("compute", [way, settling, lambda trace: 3, lambda trace: np.float32(2.0)])
def test_a_sound_score_passes(compute):
    assert check_score(score(compute)) == []


def test_a_score_is_tried_on_traces_of_its_author_too():
    from skillframe_testkit.suites import example_trace

    own = example_trace()
    own.meta["actuators"] = ["lift"]
    problems = check_score(score(lambda trace: 1.0 / ("actuators" not in trace.meta)), [own])
    assert problems == ["figures: trace 0 of those given: raised ZeroDivisionError: float division by zero"]


# -- robots


@pytest.fixture
def robot(tmp_path):
    """A copy of a shipped robot whose files can be changed: robot(of, name, {file: change})."""

    def make(of="panda", name="mine", changes=None):
        folder = tmp_path / name
        shutil.copytree(load_robot(of).folder, folder)
        for file, change in (changes or {}).items():
            for path in folder.glob(file):
                path.write_text(change(path.read_text()))
        return RobotType(name=name, summary="a robot", folder=folder)

    return make


def weightless(text):
    """A URDF whose last links weigh nothing, and cannot be accelerated."""
    import re

    return re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)


BAD_ROBOTS = {
    "has a URDF that does not load": ({"*.urdf": lambda text: text[:200]}, "loads: "),
    "names a URDF that is not there": ({"robot.toml": lambda t: t.replace(".urdf", ".udrf")}, "loads: "),
    "has a singular mass matrix": ({"*.urdf": weightless}, "dynamics: "),
    "has no arm": ({"robot.toml": lambda t: t.replace("[[arm]]", "[gone]")}, "loads: "),
    "has a key that nobody knows": ({"robot.toml": lambda t: "speed = 1\n" + t}, "unknown key 'speed'"),
}


@pytest.mark.parametrize("how", BAD_ROBOTS)
def test_a_robot_with_a_defect_is_named(how, robot):
    changes, said = BAD_ROBOTS[how]
    problems = "\n".join(check_robot(robot(changes=changes)))
    assert said in problems, problems


def test_a_robot_in_a_folder_of_another_name_is_named(robot):
    made = robot(name="mine")
    assert "call it 'other'" in check_robot(dataclasses.replace(made, name="other"))[0]


def test_a_robot_whose_folder_was_left_out_of_the_wheel_is_named(tmp_path):
    (problem,) = check_robot(RobotType(name="gone", summary="a robot", folder=tmp_path / "gone"))
    assert "does the distribution ship it?" in problem


def test_a_robot_whose_urdf_lies_outside_its_folder_is_named(robot, tmp_path):
    made = robot(of="free_tool")
    urdf = next(made.folder.glob("*.urdf"))
    shutil.move(urdf, tmp_path / urdf.name)
    toml = made.folder / "robot.toml"
    toml.write_text(toml.read_text().replace(f'"{urdf.name}"', f'"../{urdf.name}"'))
    (problem,) = check_robot(made)
    assert "lies outside its folder" in problem


def test_a_robot_that_cannot_bear_its_own_weight_is_named(robot):
    weak = {"*.urdf": lambda text: __import__("re").sub(r'effort="[\d.]+"', 'effort="0.5"', text)}
    (problem,) = check_robot(robot(changes=weak))
    assert problem.startswith("stands: holding its start in the world free for 100 ms ends: ")


@pytest.mark.parametrize("name", ["free_tool", "panda", "dual_panda", "hiab_xs031", "ur5e", "fr3", "kuka_iiwa14"])
def test_every_shipped_robot_passes(name):
    assert check_robot(registry().robot(name)) == []


# -- sections

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">{}</svg>'


def section(make, title="My section"):
    return SectionType(name="mine", summary="a section", title=title, make=make)


def whole(files):
    """Everything that a section may give, where there are results."""
    if "results.csv" not in files.names:
        return []
    rows = files.path("results.csv").read_text().splitlines()
    grid = Grid(("trials", "share < 0.5 & more"), [(len(rows) - 1, 0.25)], "counted")
    return [f"{len(rows)} lines, force <30 N>", grid, Illustration("A dot", "drawn", SVG.format('<circle r="1"/>'))]


def text_of(*parts):
    return lambda files: list(parts)


def drawing(inner):
    return text_of(Illustration("Drawn", "a caption", SVG.format(inner)))


def elsewhere(files):
    outside = next(iter(files.files.values())).parent.parent / "neighbour.csv"
    outside.write_text("1") if not outside.exists() else None
    return [outside.read_text()]


def beside(files):
    folder = next(iter(files.files.values())).parent
    return [Path(folder, "..", "..", "whole", "slide", "results.csv").read_text()[:3]]


def counting(files, kept=[0]):  # noqa: B006 - see `counts`
    kept[0] += 1
    return [f"call {kept[0]}"]


def edits(files):
    path = files.path(files.names[0])
    content = path.read_bytes()
    path.write_bytes(content + b"\n")
    return []


def traces(files):
    shown = [name for name in files.names if name.endswith(".npz")]
    return [f"{Trace.load(files.path(name)).time[-1]:.1f} s" for name in shown]


BAD_SECTIONS = {
    "injects a script": (text_of("<script>alert(1)</script>"), "holds markup, '<script>'"),
    "injects HTML into a cell": (text_of(Grid(("a",), [("<b>1</b>",)])), "holds markup, '<b>'"),
    "injects a picture": (text_of('<img src="http://x">'), "holds markup, '<img src='"),
    "writes entities": (text_of("5 &lt; 6"), "holds markup, '&lt;'"),
    "draws with a script": (drawing("<script>alert(1)</script>"), "holds '<script'"),
    "draws with a handler": (drawing('<g onclick="x()"/>'), "holds 'onclick='"),
    "draws what it loads": (drawing('<image href="http://x/y.png"/>'), "nothing in it acts or is loaded"),
    "draws no SVG": (text_of(Illustration("Drawn", "x", "<svg")), "raised ParseError"),
    "reads another campaign": (beside, "a run: reads 'results.csv', which is none of the files"),
    "reads what lies beside": (elsewhere, "reads 'neighbour.csv', which is none of the files"),
    "reads the machine": (lambda f: [Path("/etc/hostname").read_text()], "reads 'hostname'"),
    "writes a file": (lambda f: [Path("out.txt").write_text("x") and "x"], "opens the file 'out.txt' for writing"),
    "changes the results": (edits, "changes the files that it is made from"),
    "prints": (lambda f: [str(print("hello"))], "prints 'hello'"),
    "depends on call order": (counting, "gives something else for the same files when it is called again"),
    "names the machine's folders": (lambda f: [str(next(iter(f.files.values())))], "in another folder"),
    "needs results": (lambda f: [f.path("results.csv").read_text()[:3]], "a run: raised UnknownName"),
    "gives one text": (lambda f: "text", "give a list of parts"),
    "gives numbers": (text_of(1.0), "gave float, not text, Grid or Illustration"),
    "gives a ragged table": (text_of(Grid(("a", "b"), [(1,)])), "a row of its table has 1 cells"),
}


@pytest.mark.parametrize("how", BAD_SECTIONS)
def test_a_section_with_a_defect_is_named(how, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make, said = BAD_SECTIONS[how]
    problems = "\n".join(check_section(section(make)))
    assert said in problems, problems


@pytest.mark.parametrize(("title", "said"), [("", "the title is empty"), ("<b>x</b>", "the title holds markup")])
def test_a_title_that_is_none_is_named(title, said):
    assert said in check_section(section(whole, title))[0]


def test_a_section_is_made_or_drawn_and_one_of_both():
    neither = SectionType(name="mine", summary="a section", title="Mine")
    both = SectionType(name="mine", summary="a section", title="Mine", make=whole, draw=lambda page: "")
    drawn = SectionType(name="mine", summary="a section", title="Mine", draw=lambda page: "")
    assert check_section(neither) == check_section(both) == ["record: give make, or draw, and not both"]
    assert check_section(drawn) == []


@pytest.mark.parametrize("make", [whole, traces, lambda files: []])
def test_a_sound_section_passes(make):
    assert check_section(section(make)) == []
