"""A run held against simulated ones: Coulomb's law, validity whatever the distribution, estimates, and bad input."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from direct_link import DirectLink, arm
from skillframe_drive.cell import Cell
from skillframe_drive.envelope import Regression, Verdict, beyond, held
from skillframe_drive.figures import FRICTION, NAMES, Sliding, figures
from skillframe_drive.hold import (
    Box,
    Estimate,
    Held,
    Simulated,
    compare,
    covering,
    read_box,
    read_runs,
    refuse_other,
    said,
    wider,
    write_folder,
)
from skillframe_drive.runs import load_task, run_once
from skillframe_drive.section import HOLD, hold_section

from skillframe.api.campaigns import Campaign
from skillframe.api.learning import skill_of
from skillframe.campaign import evaluate, folder
from skillframe.campaign.folder import campaign_hash
from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.execution.trace import Trace
from skillframe.extend import LinkType, ReportFiles, part_problem
from skillframe.extend.registry import registry
from skillframe.frames import quaternion_from_matrix, rotation_matrix

TIP = np.array([0.0, 0.0, 0.2])


def slide(mu: float, *, slope=0.6, speed=3e-3, load=12.0, seed=0, turn=0.0, noise=1.0, touches=True) -> Trace:
    """A tip that comes down for 1 s, slides down a slope at constant speed for 4 s, and stands for 1 s.

    The tool turns by `turn` [rad] on the way, so that its controlled point, 0.2 m above the tip, moves otherwise.
    """
    rng, time = np.random.default_rng(seed), np.arange(0.0, 6.0, 0.01)
    along = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    way = np.clip(time - 1.0, 0.0, 4.0)
    down = np.clip(1.0 - time, 0.0, None)[:, None] * np.array([0.0, 0.0, 0.01])
    path = np.array([0.5, 0.0, 0.3]) + speed * way[:, None] * along + down
    contact = time >= 1.0 if touches else np.zeros(len(time), dtype=bool)
    moving = (time >= 1.0) & (time < 5.0)
    force = contact[:, None] * load * normal - (contact & moving)[:, None] * mu * load * along
    force = force + noise * 0.1 * rng.standard_normal(force.shape)
    rotation = rotation_matrix(np.outer(turn * time / 6.0, [0.0, 1.0, 0.0]))
    wrench = np.hstack([force, np.zeros((len(time), 3))])
    position = path - rotation @ TIP + noise * 5e-5 * rng.standard_normal(path.shape)
    still = np.zeros((len(time), 6))
    turned = quaternion_from_matrix(rotation)
    meta = {"center_of_compliance": [0.0, 0.0, 0.0], "frames": {"tip": TIP.tolist()}, "robot": "ur5e"}
    return Trace(
        time=time, position=position, quaternion=turned, twist=still, wrench=wrench, wrench_true=wrench,
        desired_position=position, desired_quaternion=turned, command_wrench=still, q=np.zeros((len(time), 6)),
        body_position=np.zeros((len(time), 0, 3)), body_quaternion=np.zeros((len(time), 0, 4)),
        meta={**meta, "world": "valley", "interface": {}, "bodies": []},
    )  # fmt: skip


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.7])
@pytest.mark.parametrize("turn", [0.0, 0.15])
def test_friction_follows_from_motion_and_force_alone(mu, turn):
    """Coulomb's law, and noise of 0.1 N in 12 N, and of 50 um in 1.5 mm, averaged over 50 samples, leaves 0.01."""
    found = figures(slide(mu, turn=turn))
    assert found[FRICTION] == pytest.approx(mu, abs=0.015)
    assert found[NAMES.index("end, x")] == pytest.approx(0.5 + 0.012 * np.cos(0.6), abs=3e-4)
    assert found[NAMES.index("first touch, z")] == pytest.approx(0.3, abs=3e-4)
    assert found[NAMES.index("turn about y")] == pytest.approx(turn, abs=1e-3)
    assert np.exp(found[NAMES.index("log time, touch to end")]) == pytest.approx(5.0, abs=0.02)


def test_a_run_without_contact_or_sliding_has_no_friction():
    free = figures(slide(0.3, touches=False))
    assert np.isnan(free[FRICTION]) and np.isnan(free[NAMES.index("first touch, x")])
    stuck = figures(slide(0.3, speed=0.0))
    assert np.isnan(stuck[FRICTION]) and np.isfinite(stuck[NAMES.index("first touch, x")])


def test_samples_in_which_the_tip_turns_onto_another_face_do_not_count():
    """A second face, at 70 degrees to the first: forces of both in one average would give another friction."""
    one, two = slide(0.2, noise=0.0), slide(0.2, slope=-0.6, noise=0.0)
    joined = replace(
        one, position=np.concatenate([one.position[:300], two.position[300:] + one.position[299] - two.position[300]]),
        wrench=np.concatenate([one.wrench[:300], two.wrench[300:]]),
    )  # fmt: skip
    found = Sliding(joined)
    assert found.friction.max() < 0.23 and found.friction.min() > 0.149  # a tenth of the other face; a quarter at rest
    assert np.median(found.friction) == pytest.approx(0.2, abs=1e-9) and 200 < found.at.sum() < 350  # of 400


def sample(rng, count, friction=(0.1, 0.4)):
    """Quantities and figures (count, 4) of a law that only the test knows, the last one with heavy tails."""
    drawn = np.stack([rng.uniform(-10.0, 10.0, count), rng.uniform(*friction, count)], axis=1)
    place = drawn[:, 0] + 0.3 * rng.standard_normal(count)
    rubbed = drawn[:, 1] + 0.005 * rng.standard_normal(count)
    time = 1.0 + drawn[:, 1] ** 2 + 0.02 * drawn[:, 0] + 0.05 * rng.standard_normal(count)
    return drawn, np.stack([place, rubbed, time, rng.standard_cauchy(count)], axis=1)


LOW, HIGH = np.array([-10.0, 0.1]), np.array([10.0, 0.4])


def shares(count=300, **box):
    rng, found = np.random.default_rng(1), []
    for _ in range(count):
        drawn, wide = sample(rng, 60, (0.0, 0.7))
        _, inside = sample(rng, 60)
        _, own = sample(rng, 1, **box)
        found.append(held(inside, own[0], LOW, HIGH, Regression(wide, drawn)))
    return found


def test_runs_of_the_box_are_called_outside_in_five_of_a_hundred_at_most():
    """Valid for any distribution: one figure has no variance at all. 300 repeats: 0.05 + 2.3 standard deviations."""
    found = shares()
    assert np.mean([each.p <= 0.05 for each in found]) <= 0.08
    for score in ("p_box", "p_any"):
        ranks = np.array([getattr(each, score) for each in found])
        for level in (0.1, 0.3, 0.5):
            assert np.mean(ranks <= level) <= level + 0.08  # 2.8 standard deviations
    below = np.mean([each.p_box <= 0.5 for each in found])
    assert below == pytest.approx(0.5, abs=0.08)  # exact where no two scores are equal


def test_a_friction_of_a_half_is_outside_where_four_tenths_are_certified():
    found = shares(60, friction=(0.5, 0.5))
    assert np.mean([each.p <= 0.05 for each in found]) >= 0.8
    assert np.median([each.p_any for each in found]) > 0.0  # the box's quantities tell it


def test_a_run_that_differs_in_nothing_of_the_box_is_found_by_its_other_figures():
    rng = np.random.default_rng(2)
    drawn, wide = sample(rng, 60, (0.0, 0.7))
    _, inside = sample(rng, 60)
    inside, wide = inside[:, :3], wide[:, :3]
    strange = inside[7] + [0.0, 0.0, 4.0]
    verdict = held(inside, strange, LOW, HIGH, Regression(wide, drawn))
    assert verdict.p_any == pytest.approx(1.0 / 61.0) and verdict.p <= 0.05


def test_the_distance_beyond_all_others_is_that_of_its_definition():
    rng = np.random.default_rng(3)
    values = rng.standard_normal((20, 3))
    values[4, 1] = np.nan
    total = beyond(values)
    filled = np.where(np.isnan(values), np.nanmedian(values, axis=0), values)
    for i in range(20):
        others = np.delete(filled, i, axis=0)
        low, high = others.min(axis=0), others.max(axis=0)
        out = np.maximum(np.maximum(low - filled[i], filled[i] - high), 0.0) / (high - low)
        assert total[i] == pytest.approx(out.sum() + (i == 4))  # the only one without that figure


def test_estimates_follow_a_quadratic_law_and_their_half_widths_cover():
    rng = np.random.default_rng(4)
    drawn, seen = sample(rng, 150, (0.0, 0.7))
    fresh, shown = sample(rng, 400, (0.0, 0.7))
    shown, seen = shown[:, :3], seen[:, :3]
    regression = Regression(seen, drawn)
    off = np.abs(regression.estimate(shown) - fresh)
    assert np.median(off[:, 1]) < 0.006 and np.median(off[:, 0]) < 0.3
    covered = (off <= regression.half_width(shown[0])).mean(axis=0)
    assert np.all((covered > 0.85) & (covered < 0.95))


def test_a_friction_that_is_measured_stands_in_for_the_estimated_one_where_there_is_one():
    rng = np.random.default_rng(6)
    drawn, seen = sample(rng, 150, (0.0, 0.7))
    seen = seen[:, :3]
    seen[::3, 1] = np.nan
    plain, direct = Regression(seen, drawn), Regression(seen, drawn, (1, 1))
    slid, stuck = seen[1].copy(), seen[0]
    slid[1] = 0.9  # beyond all that the regression has seen
    assert direct.estimate(slid[None])[0, 1] == 0.9
    assert direct.estimate(stuck[None])[0, 1] == plain.estimate(stuck[None])[0, 1]
    assert direct.half_width(slid)[1] == pytest.approx(1.645 * 0.005, rel=0.3)  # 90 % of the noise, 0.005
    assert direct.half_width(stuck)[1] > 0.05


def test_a_run_without_friction_gets_the_half_width_of_such_runs():
    rng = np.random.default_rng(5)
    drawn, seen = sample(rng, 150, (0.0, 0.7))
    seen[::3, 1] = np.nan
    seen = seen[:, :2]
    regression = Regression(seen, drawn)
    known, unknown = regression.half_width(seen[1]), regression.half_width(seen[0])
    assert known[1] < 0.04 and unknown[1] > 0.2


def test_a_range_that_covers_an_estimate_holds_the_certified_one_and_stays_possible():
    over = Estimate("world.friction", 0.55, 0.06, 0.1, 0.4)
    assert not over.covered and over.covering() == (0.1, 0.61)
    assert Estimate("world.friction", 0.44, 0.06, 0.1, 0.4).covered
    assert Estimate("world.friction", 0.06, 0.06, 0.1, 0.4).covered
    low = Estimate("world.friction", 0.02, 0.05, 0.1, 0.4)
    assert low.covering() == (0.0, 0.4)  # no negative friction


@pytest.fixture
def certified(tmp_path, valley_skill):
    """The folder of a certificate, with its campaign and without its trials."""
    place = tmp_path / "certified"
    vary = {"fixture.offset_x": {"uniform": [-0.004, 0.004]}, "world.friction": {"uniform": [0.1, 0.4]}}
    plan = Campaign(world="valley", skills=str(valley_skill), robot="fr3", trials=4, seed=5, vary=vary,
                    set={"start.offset_z": 0.012}, duration_s=6.0)  # fmt: skip
    fresh = place / "claim1" / "fresh"
    fresh.parent.mkdir(parents=True)
    spec = folder.prepare(plan.spec, fresh, evaluate.describe, registry().world("valley").params)
    box = {name: axis["uniform"] for name, axis in vary.items()}
    predicate = {"certified": True, "claim": 1, "campaign": campaign_hash(spec), "box": box}
    (place / "certificate.json").write_text(json.dumps({"predicate": predicate}))
    return place


def test_the_box_of_a_certificate_is_read_and_widened(certified):
    box = read_box(certified)
    assert box.names == ("fixture.offset_x", "world.friction") and box.high[1] == 0.4
    assert read_box(certified / "certificate.json").spec == box.spec
    low, high = wider(box)
    assert high == pytest.approx([0.008, 0.55]) and low == pytest.approx([-0.008, 0.0])
    slopes = box._replace(names=("world.slope", "world.friction"), low=np.array([0.7, 0.1]), high=np.array([0.8, 0.4]))
    low, high = wider(slopes)
    assert low[0] == pytest.approx(0.65) and high[0] == pytest.approx(0.85)
    steep = slopes._replace(low=np.array([0.7, 0.1]), high=np.array([1.3, 0.4]))
    assert wider(steep)[1][0] == 1.3  # 1.6 rad is no slope


def change(place, **predicate):
    content = json.loads((place / "certificate.json").read_text())
    content["predicate"].update(predicate)
    (place / "certificate.json").write_text(json.dumps(content))


def test_a_certificate_that_cannot_be_used_is_refused(certified, tmp_path):
    with pytest.raises(InputError, match="holds no certificate"):
        read_box(tmp_path)
    change(certified, campaign="0")
    with pytest.raises(InputError, match="was changed after the certificate"):
        read_box(certified)
    change(certified, claim=None)
    with pytest.raises(InputError, match="an earlier skillframe"):
        read_box(certified)
    change(certified, certified=False)
    with pytest.raises(InputError, match="certifies no box"):
        read_box(certified)
    (certified / "certificate.json").write_text("[1]")
    with pytest.raises(InputError, match="is no certificate"):
        read_box(certified)


def test_a_run_of_something_else_than_was_certified_is_refused(certified, tmp_path):
    box, one, path = read_box(certified), slide(0.2), tmp_path / "run.npz"
    for changed, sentence in (({"skill_sha256": "0"}, "another skill"), ({"slow": 0.3}, "a slowed or a dry run")):
        replace(one, meta={**one.meta, **changed}).save(path)
        with pytest.raises(InputError, match=sentence):
            read_runs([path], box)
    replace(one, time=5.0 * one.time).save(path)
    with pytest.raises(InputError, match="50 samples a second"):
        read_runs([path], box)
    for changed, sentence in (
        ({"robot": "fr3"}, "another robot"),
        ({"center_of_compliance": [0.0, 0.0, 0.1]}, "another centre of compliance"),
    ):
        with pytest.raises(InputError, match=sentence):
            refuse_other(replace(one, meta={**one.meta, **changed}), one, "run")
    refuse_other(one, one, "run")


def test_no_run_takes_the_place_of_another_of_the_same_name(certified, tmp_path):
    box = read_box(certified)
    paths = [tmp_path / folder / "run.npz" for folder in ("monday", "tuesday")]
    for path in paths:
        path.parent.mkdir()
        slide(0.2).save(path)
    assert list(read_runs(paths[:1], box)) == ["run"]
    with pytest.raises(InputError, match="has the name of another run"):
        read_runs(paths, box)


def slides(count, seed, low, high):
    rng = np.random.default_rng(seed)
    mus, slopes = rng.uniform(low, high, count), rng.uniform(0.5, 0.7, count)
    traces = [slide(mu, slope=slope, seed=seed + i) for i, (mu, slope) in enumerate(zip(mus, slopes, strict=True))]
    return Simulated(np.array([figures(each) for each in traces]), np.stack([slopes, mus], axis=1), traces)


def test_a_run_with_more_friction_is_told_from_the_certified_with_the_line_that_covers_it(certified, tmp_path):
    spec = read_box(certified).spec
    box = Box(spec, ("fixture.tilt_y", "world.friction"), np.array([0.5, 0.1]), np.array([0.7, 0.4]))
    reference, wide = slides(60, 1000, 0.1, 0.4), slides(60, 2000, 0.0, 0.7)
    rubbed, usual = slide(0.6, seed=7), slide(0.25, seed=8)
    found, inside = compare(rubbed, box, reference, wide), compare(usual, box, reference, wide)
    assert found.outside and not inside.outside
    assert found.estimates[1].value == pytest.approx(0.6, abs=0.03)
    low, high = covering(found)["world.friction"]["uniform"]
    assert low == 0.1 and 0.58 < high < 0.7 and not covering(inside)
    text = "\n".join(said(found))
    assert "outside what was certified" in text and '"world.friction" = { uniform = [0.1,' in text
    assert "friction without a model 0.60" in text
    out = tmp_path / "held"
    write_folder(out, {"rubbed": (rubbed, found), "usual": (usual, inside)}, box, reference)
    assert len(list((out / "traces").glob("real_*.npz"))) == 2
    nearest = [Trace.load(path) for path in (out / "traces").glob("simulated_*.npz")]
    assert 3 <= len(nearest) <= 6
    files = ReportFiles(title="held", files={HOLD: out / HOLD})
    parts = list(hold_section(files))
    assert not any(part_problem(part) for part in parts) and files.used == [HOLD]
    pictures = [part.svg for part in parts if hasattr(part, "svg")]
    assert len(pictures) == 2 and "&#8594;" in pictures[0] and pictures[0].count("<circle") > 60
    assert hold_section(ReportFiles(title="other", files={})) == []


def test_runs_that_never_slide_can_be_held_too(certified, tmp_path):
    box = read_box(certified)
    box = box._replace(names=box.names[:1], low=np.array([0.5]), high=np.array([0.7]))
    slopes = np.linspace(0.5, 0.7, 45)
    traces = [slide(0.2, slope=slope, speed=0.0, seed=i) for i, slope in enumerate(slopes)]
    simulated = Simulated(np.array([figures(each) for each in traces]), slopes[:, None], traces)
    found = compare(slide(0.2, slope=0.6, speed=0.0, seed=99), box, simulated, simulated)
    assert np.isnan(found.figures[FRICTION]) and not found.outside
    slid = compare(slide(0.2, slope=0.6, seed=98), box, simulated, simulated)
    assert slid.verdict.p_any == pytest.approx(1.0 / 46.0) and FRICTION in slid.odd
    write_folder(tmp_path / "held", {"still": (traces[0], found)}, box, simulated)
    assert list(hold_section(ReportFiles(title="held", files={HOLD: tmp_path / "held" / HOLD})))


def test_what_no_quantity_explains_is_said_to_be_something_else():
    estimate = Estimate("world.friction", 0.2, 0.05, 0.1, 0.4)
    found = Held(np.full(len(NAMES), np.nan), Verdict(0.5, 0.01), [estimate], [NAMES.index("end, y")])
    assert "none of the box's quantities explains it" in "\n".join(said(found))
    assert "end, y" in "\n".join(said(found)) and not covering(found)


def test_the_command_line_refuses_what_it_cannot_use(tmp_path, capsys, certified):
    (tmp_path / "run.npz").write_bytes(b"no")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a").write_text("a")
    slide(0.2).save(tmp_path / "good.npz")
    for words, sentence in (
        (["run.npz", "--certificate", "certified"], "run.npz"),
        (["good.npz", "--certificate", "full"], "holds no certificate"),
        (["good.npz", "--certificate", "certified", "--out", "full"], "not an empty folder"),
        (["good.npz", "--certificate", "certified", "--trials", "10"], "39"),
    ):
        capsys.readouterr()
        paths = [str(tmp_path / w) if not w.startswith("--") and not w.isdigit() else w for w in words]
        assert run(["drive", "hold", *paths]) == 2
        assert sentence in capsys.readouterr().err


@pytest.mark.slow
def test_runs_through_a_link_are_held_by_one_command_and_shown_by_the_report(
    tmp_path, valley_skill, certified, monkeypatch, capsys
):
    """A torque-controlled arm at a fixture 2 mm from nominal, and 10 mm: 4 mm are certified."""
    pytest.importorskip("skillframe_reports")
    record = LinkType(name="direct_torque", summary="", takes="torque", open=lambda host: pytest.fail("not opened"))
    found, real = registry(), registry().record
    monkeypatch.setattr(found, "record", lambda kind, name: record if name == record.name else real(kind, name))
    task = load_task(Cell(robot="fr3", link="direct_torque", host="", world="valley"))
    for name, offset in (("near", 0.002), ("far", 0.010)):
        fake = arm("fr3", fixture__offset_x=offset, start__offset_z=0.012, world__friction=0.25, seed=3)
        run_once(
            skill_of(valley_skill), task, DirectLink(fake, "torque", 0.001), coc=None, slow=1.0, dry=False,
            duration_s=6.0, rate_hz=100.0, done=lambda: True,
        ).save(tmp_path / f"{name}.npz")  # fmt: skip
    words = [str(tmp_path / "near.npz"), str(tmp_path / "far.npz"), "--certificate", str(certified), "--trials", "39"]
    assert run(["drive", "hold", *words, "--out", str(tmp_path / "held"), "--json"]) == 1
    near, far = json.loads(capsys.readouterr().out)
    assert not near["outside"] and far["outside"]
    offsets = [each["estimates"][0]["value"] for each in (near, far)]
    assert offsets == pytest.approx([0.002, 0.010], abs=0.0015)
    low, high = far["vary"]["fixture.offset_x"]["uniform"]
    assert low == -0.004 and 0.009 < high < 0.013 and not near["vary"]
    assert run(["report", str(tmp_path / "held"), "--out", str(tmp_path / "held.html")]) == 0
    page = (tmp_path / "held.html").read_text()
    assert "Held against the simulation" in page and "far: outside what was certified" in page
