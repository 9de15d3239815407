"""The first page: a verdict, what it rests on, and a typical run first."""

import hashlib
import html
import json
import re
import shutil
from statistics import median

import pytest
from skillframe_reports.page import render
from skillframe_reports.results import Results, read_results
from skillframe_reports.setup_section import interface_words, taught_by
from skillframe_reports.sources import read_chapters
from skillframe_reports.typical import telling, typical
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.extend.reading import write_demonstration
from tests.report_fakes import COLUMNS, rows, trace, write_csv
from tests.report_fakes import campaign as full_campaign

PEG = "peg.skill.json"
SETUP = {
    "limits": {"force_n": 40.0, "transient": 2.0}, "control": {"rate_hz": 1000.0}, "drive": "", "base": "fixed",
    "sensors": {"force_noise": 0.3},
    "nominal": {"robot.mass_scale": 1.0, "fixture.offset_x": 0.0, "sensor.force_noise": 0.3},
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    made = full_campaign(tmp_path / "peg")
    shutil.rmtree(made / "traces")
    return made


def asked(folder, expect):
    spec = folder / "campaign.toml"
    spec.write_text(spec.read_text(encoding="utf-8") + f"\n[expect]\n{expect}\n", encoding="utf-8")
    return folder


def page(folder):
    return render(read_chapters([folder]))


def word(text):
    return re.search(r'class="verdict (\w+)"', text)[1]


def plain(text):
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", text)))


def interval(folder):
    results = read_chapters([folder])[0].results
    return results.rate(PEG)


@pytest.mark.parametrize(
    ("bound", "said"),
    [
        (lambda found: found.interval.low - 0.001, "pass"),
        (lambda found: found.interval.high + 0.001, "fail"),
        (lambda found: found.share, "undecided"),
    ],
)
def test_the_verdict_follows_from_requirement_and_interval(folder, bound, said):
    required = bound(interval(folder))
    text = page(asked(folder, f"rate = {required}"))
    assert word(text) == said
    found = interval(folder)
    banner = plain(text[text.index('class="verdict ') : text.index("</section>")])
    assert f"{PEG}: {found.successes} of {found.trials} trials" in banner
    assert (
        f"95 % confidence interval {100 * found.interval.low:.1f}-{100 * found.interval.high:.1f} % (Clopper-Pearson)"
        in banner
    )
    assert f"{said} :" in banner


def test_the_verdict_is_on_the_skill_that_the_requirement_names(folder):
    assert word(page(asked(folder, 'rate = 0.5\nskill = "replay:demo1.npz"'))) == "fail"


def test_without_a_requirement_there_is_no_verdict(folder):
    text = page(folder)
    assert 'aria-label="Verdict"' not in text and "undecided" not in plain(text)


def test_an_interval_is_said_once_a_skill_on_the_first_screen(folder):
    text = page(folder)
    opening = plain(text[text.index('class="hero"') : text.index("</header>", text.index('class="hero"'))])
    assert opening.count("95 % confidence interval") == 2 and opening.count(" force") <= 4


def test_the_range_that_was_declared_is_told_and_not_what_was_drawn(folder):
    text = page(folder)
    opening = plain(text[text.index('class="hero"') : text.index("</header>", text.index('class="hero"'))])
    assert "\N{MINUS SIGN}4 to 4 mm" in opening


def test_an_unfinished_campaign_is_undecided_however_well_it_does(folder):
    write_csv(folder / "results.csv", rows(60), COLUMNS)
    text = page(asked(folder, "rate = 0.01"))
    assert word(text) == "undecided"
    assert "the campaign has not ended" in text


def test_a_table_that_was_changed_decides_nothing(folder):
    summary = {"hashes": {"results.csv": "0" * 64}}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    text = page(asked(folder, "rate = 0.01"))
    assert word(text) == "undecided"
    assert "was changed after the campaign" in text


def test_a_simulated_teacher_is_told_from_a_recording_and_from_nobody_knows(folder):
    shown = example_demonstrations()[0]
    hashes = []
    for name, meta in (("a", {"simulated": {"kind": "kinesthetic"}, "teacher": "kinesthetic"}), ("b", {})):
        path = folder / "demonstrations" / f"{name}.npz"
        object.__setattr__(
            shown, "meta", {k: v for k, v in shown.meta.items() if k not in ("simulated", "teacher")} | meta
        )
        write_demonstration(shown, path)
        hashes.append(hashlib.sha256(path.read_bytes()).hexdigest())
    document = json.loads((folder / "skills" / PEG).read_text())
    document["learned_from"] = [{"file": "x", "sha256": digest} for digest in (*hashes, "0" * 64)]
    (folder / "skills" / PEG).write_text(json.dumps(document))
    said, simulated = taught_by(read_chapters([folder])[0], PEG)
    assert simulated
    assert said.startswith(
        "one demonstration by a simulated teacher (kinesthetic) and one demonstration from a recording"
    )
    assert "not known" in said


def test_a_skill_file_that_says_who_taught_needs_no_recording_beside_it(folder):
    document = json.loads((folder / "skills" / PEG).read_text())
    document["learned_from"] = [{"file": "x", "sha256": "0", "simulated": True, "teacher": "blind"}] * 2
    (folder / "skills" / PEG).write_text(json.dumps(document))
    assert taught_by(read_chapters([folder])[0], PEG) == ("2 demonstrations by a simulated teacher (blind)", True)


def test_an_interface_is_an_ideal_torque_source_unless_the_robot_says_otherwise():
    assert interface_words({"control": {"rate_hz": 1000}}).startswith("ideal torque source")
    assert interface_words({"control": {"interface": "torque"}}).startswith("ideal torque source")
    position = interface_words({"control": {"interface": "position", "rate_hz": 125, "delay_s": 0.008}})
    assert position == "position interface, delay s 0.008"
    assert interface_words({"drive": "servo"}) == "electric servos, simulated"
    assert interface_words({"drive": "wind", "driven": {"by": "eight thrusters"}}) == "eight thrusters, simulated"
    assert interface_words({"drive": "wind"}) == "the drive wind, simulated"
    assert interface_words({}).startswith("not known")


def test_what_robot_toml_says_stands_where_a_campaign_noted_nothing(folder):
    (folder / "robots" / "x").mkdir(parents=True)
    (folder / "robots" / "x" / "robot.toml").write_text('summary = "An arm"\n[control]\ninterface = "velocity"\n')
    text = plain(page(folder))
    assert "velocity interface" in text
    assert "An arm" in text


@pytest.mark.parametrize(("kind", "said"), [("", "of its [[actuation]]"), ('[drive]\nkind = "steam"\n', "steam")])
def test_of_a_drive_that_is_noted_nowhere_no_law_and_no_sensor_of_an_arm_is_told(folder, kind, said):
    (folder / "robots" / "x").mkdir(parents=True)
    (folder / "robots" / "x" / "robot.toml").write_text(f'{kind}[[actuation]]\njoint = "j"\nfmu = "x"\n')
    text = plain(page(folder))
    assert f"the drive {said}, simulated" in text and "the controller of its drive" in text
    assert "impedance of the tool" not in text and "its sampled bias" not in text
    assert "here they agree" not in text


def noted(folder):
    scene = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps({**scene, "setup": SETUP}))
    return folder


def test_the_nearest_limit_is_named_with_its_typical_and_its_worst_trial(folder):
    table = [[t, PEG, 7, 0.001 * t, 0.0, 1, "", 3.0, force, 0.001, 0.01, share] for t, force, share in
             ((0, 10.0, 0.5), (1, 44.0, 0.2), (2, 12.0, 0.9))]  # fmt: skip
    write_csv(folder / "results.csv", table, [*COLUMNS, "peak_torque_share"])
    text = plain(page(noted(folder)))
    assert (
        "Nearest of peg.skill.json's 3 trials: torque commanded to the most loaded joint , 90 % of its limit in trial 2"
        in text
    )
    assert "the URDF's 50 % trial 0 90 % trial 2" in text
    # the force of one tick is held to twice 40 N: the median 12 N is 15 % of it, the largest 44 N 55 %
    assert "80 N 15 % 12 N, trial 2 55 % 44 N, trial 1" in text


def test_what_varied_is_not_listed_as_standing_still_and_the_rest_is(folder):
    text = plain(page(noted(folder)))
    varied, still = text.index("What was varied"), text.index("What was not varied")
    blind = text.index("What this simulation cannot show")
    assert "fixture tilt about y: −17.2 to 17.2 °, uniform" in text[varied:still]
    assert "fixture along y, z and about x, z: at the nominal place" in text[still:blind]
    assert "robot mass scale at 1 (nominal)" in text[still:blind]
    assert "clearance 0.25 mm" in text[still:blind]
    assert "fixture offset x" not in text[still:blind]


def test_a_robot_s_quantity_that_varies_or_is_set_elsewhere_is_not_said_to_stand_at_its_nominal_value(folder):
    spec = (folder / "campaign.toml").read_text(encoding="utf-8")
    moved = spec.replace(
        "[vary]\n", '[set]\n"sensor.force_noise" = 0.6\n[vary]\n"robot.mass_scale" = { uniform = [0.9, 1.1] }\n'
    )
    (folder / "campaign.toml").write_text(moved, encoding="utf-8")
    text = plain(page(noted(folder)))
    assert "robot mass scale: 0.9 to 1.1, uniform" in text
    assert "robot mass scale at" not in text
    assert "sensor force noise at 0.6 N (as the campaign sets it)" in text
    assert "sensor force noise at 0.3" not in text


def test_both_halves_of_an_end_are_counted(folder):
    table = [[t, PEG, 7, 0.1 * t, 0.0, 1, "", 3.0, 1.0, 0.0, 0.0, 1, int(t > 0)] for t in range(3)]
    write_csv(folder / "results.csv", table, [*COLUMNS, "goal_reached", "ended_itself"])
    text = plain(page(folder))
    assert "goal reached and ended by itself: 2; goal reached, not ended by itself: 1" in text


def test_the_typical_row_is_the_one_nearest_to_the_median(folder):
    table = read_results(folder / "results.csv").of(PEG)
    found = typical(table, "duration_s")
    middle = median(row.values["duration_s"] for row in table)
    assert all(abs(row.values["duration_s"] - middle) >= abs(found.values["duration_s"] - middle) for row in table)
    assert typical(table, "no such column") is None


def test_the_typical_success_is_shown_first_and_not_trial_0(folder, tmp_path):
    table = [[t, PEG, 7, 0.1 * t, 0.0, int(t < 5), "", seconds, 1.0, 0.0, 0.0]
             for t, seconds in enumerate((9.0, 3.0, 5.0, 4.0, 2.0, 1.0))]  # fmt: skip
    write_csv(folder / "results.csv", table)
    results = read_results(folder / "results.csv")
    assert isinstance(results, Results)
    durations = {0: 9.0, 1: 3.0, 2: 5.0, 5: 1.0}
    found = [
        (tmp_path / f"{t}.npz", trace(samples=2, trial=t, duration_s=s, success=t < 5)) for t, s in durations.items()
    ]
    beside = (tmp_path / "a.npz", trace(samples=2, trial=None, duration_s=4.0))
    # the median of the five successes is 4 s; trials 1 and 2 are equally near, and the earlier one counts
    assert [path.name for path, _ in telling([beside, *found], results)] == ["1.npz", "5.npz"]


def test_a_chapter_of_a_campaign_says_why_its_first_run_is_shown(folder):
    (folder / "traces").mkdir()
    trace(samples=20, trial=3, duration_s=3.5).save(folder / "traces" / "a.npz")
    (run,) = read_chapters([folder])[0].runs
    assert "nearest to their median duration" in run.why
