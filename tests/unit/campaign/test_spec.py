import pytest
from campaign_fakes import FakeParams, write_campaign
from hypothesis import given
from hypothesis import strategies as st

from skillframe.campaign.folder import load, prepare, to_toml
from skillframe.campaign.sampling import Axis
from skillframe.campaign.spec import CampaignSpec
from skillframe.document.file import parse_source
from skillframe.errors import InputError, SkillframeError


def read(path):
    return CampaignSpec.from_toml(path, FakeParams)


def test_a_campaign_file_is_read_with_every_kind_of_axis(campaign):
    spec = read(campaign(trials=12, extra="""
"world.clearance" = { grid = [0.0001, 0.0002] }
"start.tilt_x" = { grid = { from = -0.1, to = 0.1, count = 3 } }
"start.offset_y" = { sobol = [-0.01, 0.01] }
"world.profile" = { choice = ["round", "square"] }
"start.offset_z" = { values = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11] }
[set]
"world.segments" = 24
[expect]
rate = 0.9
"""))  # fmt: skip
    assert spec.cells == 6
    assert spec.vary["start.tilt_x"] == Axis(kind="grid", numbers=(-0.1, 0.0, 0.1))
    assert spec.vary["start.offset_z"].numbers == tuple(float(i) for i in range(12))
    assert spec.fixed == {"world.segments": 24}
    assert (spec.stop.interval_width, spec.expect.rate) == (None, 0.9)
    assert spec.labels == ("a.skill.json", "replay:demo.npz")


def test_quantities_may_be_written_as_dotted_keys_and_as_sub_tables(tmp_path):
    text = (
        tmp_path,
        "start.tilt_z = {{ uniform = [0, 1] }}\n[vary.sensor]\nforce_noise = {{ choice = [0.1] }}\n{extra}",
    )
    from campaign_fakes import TEXT

    head = TEXT.partition("[vary]")[0]
    spec = read(write_campaign(text[0], text=head + "[vary]\n" + text[1]))
    assert list(spec.vary) == ["start.tilt_z", "sensor.force_noise"]


BAD = {
    '"world.clearence" = { uniform = [0, 1] }': "did you mean 'world.clearance'?",
    '"start.tilt" = { uniform = [0, 1] }': "did you mean 'start.tilt_",
    '"strat.tilt_y" = { uniform = [0, 1] }': "did you mean 'start.tilt_y'?",
    '"actuator.gain" = { uniform = [0, 1] }': "unknown quantity 'actuator.gain'",
    '"start.tilt_x" = { unifrom = [0, 1] }': "did you mean 'uniform'?",
    '"start.tilt_x" = { uniform = [1, 1] }': "low 1.0 is not below high 1.0",
    '"start.tilt_x" = { uniform = [0, 1, 2] }': "expected [low, high]",
    '"start.tilt_x" = { uniform = [0, inf] }': "give a finite number",
    '"start.tilt_x" = { normal = [nan, 1] }': "not a number",
    '"start.tilt_x" = { normal = [0, -1] }': "standard deviation -1.0 is negative",
    '"start.tilt_x" = { choice = [] }': "is empty",
    '"start.tilt_x" = { choice = ["a"] }': "expected a number, got 'a'",
    '"world.segments" = { choice = [1.5] }': "expected a whole number, got 1.5",
    '"start.tilt_x" = { grid = [1, 1] }': "holds a value twice",
    '"start.tilt_x" = { grid = { from = 0, to = 1 } }': "expected from, to and count",
    '"start.tilt_x" = { grid = { from = 0, to = 1, count = 1 } }': "give at least 2",
    '"start.tilt_x" = { grid = { form = 0, to = 1, count = 2 } }': "did you mean 'from'?",
    '"start.tilt_x" = { values = [0, 1] }': "2 values for 128 trials",
    '"start.tilt_x" = 0.1': "expected one distribution",
    '"start.tilt_x" = { uniform = [0, 1], normal = [0, 1] }': "expected one distribution",
    '[set]\n"world.friction" = 0.1': "is both fixed and varied",
    '[set]\n"world.segments" = "many"': "expected a whole number",
    '"start.tilt_x" = { grid = [0, 1] }\n[stop]\ninterval_width = 0.1': "cannot stop early over start.tilt_x: grid and",
    '"start.tilt_x" = { grid = [0, 1] }\n[stop]\ninterval_width = 0.2': "make these axes uniform or sobol, or leave",
    '"start.tilt_x" = { values = '
    + str(list(range(128)))
    + " }\n[stop]\ninterval_width = 0.1": "cannot stop early over start.tilt_x: grid and values axes run in order",
    "[stop]\ninterval_width = 2.0": "give a number between 0 and 1",
    "[stop]\ninterval = 0.1": "did you mean 'interval_width'?",
    "[expect]\nrate = 1.5": "give a number from 0 to 1",
    '[expect]\nskill = "b"': "no skill is called 'b'",
    '"start.tilt_x" = { grid = { from = 0, to = 1, count = 200 } }': "leave some of the grid's 200 cells empty",
}


@pytest.mark.parametrize("extra", BAD)
def test_what_is_wrong_in_a_campaign_file_is_refused_with_file_and_key(campaign, extra):
    path = campaign(extra=extra)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert BAD[extra] in str(caught.value)


TOP = {
    ("trials = {trials}", "trials = 0"): "trials: is 0",
    ("trials = {trials}", "trials = 99999999999999"): "trials: is 99999999999999; give 1 to 10000000",
    ("trials = {trials}", "trials = 1.5"): "expected a whole number",
    ("trials = {trials}", "trails = 3"): "did you mean 'trials'?",
    ("seed = 7", "seed = -1"): "seed: is -1",
    ("seed = 7", ""): "missing seed",
    ("duration_s = 5.0", "duration_s = 0.0"): "duration_s: 0 s is beyond 1ms to 86400s",
    ("duration_s = 5.0", "duration_s = inf"): "duration_s: inf s is beyond 1ms to 86400s",
    ("duration_s = 5.0", 'duration_s = "5mm"'): "duration_s: expected a quantity in s, got 5mm",
    ('["a.skill.json", "replay:demo.npz"]', "[]"): "name at least one skill",
    ('["a.skill.json", "replay:demo.npz"]', '["b.skill.json"]'): "no such file: b.skill.json",
    ('["a.skill.json", "replay:demo.npz"]', '["a.skill.json", "./a.skill.json"]'): "a second skill is called",
    (
        '["a.skill.json", "replay:demo.npz"]',
        '["replay:"]',
    ): "skills[0]: 'replay:' names no demonstration; write for example replay:demo.npz",
    ("seed = 7", "seed = 7\nseed = 8"): "is not valid TOML",
}


@pytest.mark.parametrize("change", TOP)
def test_wrong_top_level_keys_are_refused(tmp_path, change):
    from campaign_fakes import TEXT

    path = write_campaign(tmp_path, text=TEXT.replace(*change))
    with pytest.raises(InputError, match=r"campaign\.toml") as caught:
        read(path)
    assert TOP[change] in str(caught.value)


def test_an_unknown_world_is_refused_with_a_suggestion(tmp_path):
    from campaign_fakes import TEXT

    with pytest.raises(SkillframeError, match="did you mean 'valley'"):
        CampaignSpec.from_toml(write_campaign(tmp_path, text=TEXT.replace('"fake"\nskills', '"vally"\nskills')))


NUMBERS = st.floats(-1e6, 1e6)
AXES = st.one_of(
    st.tuples(NUMBERS, NUMBERS).filter(lambda p: p[0] < p[1]).map(lambda p: Axis(kind="uniform", numbers=p)),
    st.tuples(NUMBERS, st.floats(0, 1e6)).map(lambda p: Axis(kind="normal", numbers=p)),
    st.lists(NUMBERS, min_size=1, max_size=4).map(lambda v: Axis(kind="choice", numbers=tuple(v))),
)


@given(axes=st.dictionaries(st.sampled_from(["start.tilt_x", "robot.mass_scale", "world.clearance"]), AXES),
       name=st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=20))  # fmt: skip
def test_a_campaign_survives_json_and_toml_unchanged(tmp_path_factory, axes, name):
    folder = tmp_path_factory.mktemp("c")
    spec = read(write_campaign(folder))
    spec = CampaignSpec.from_plain({**spec.plain(), "name": name or "x"}, folder)
    spec = CampaignSpec.from_plain({**spec.plain(), "vary": {k: a.plain() for k, a in axes.items()}}, folder)
    (folder / "again.toml").write_text(to_toml(spec), encoding="utf-8")
    assert read(folder / "again.toml") == spec


def test_a_prepared_folder_needs_nothing_but_itself(campaign, tmp_path):
    path = campaign(trials=4)
    spec = prepare(read(path), tmp_path / "deep" / "out", lambda spec: {"fixture": []}, FakeParams)
    for name in ("a.skill.json", "demo.npz", "campaign.toml"):
        (tmp_path / name).unlink()
    assert load(tmp_path / "deep" / "out", FakeParams) == spec
    assert spec.labels == ("a.skill.json", "replay:demo.npz")
    assert (spec.folder / spec.robot).is_file()
    assert (spec.folder / "robots" / "box" / "box.urdf").is_file()
    assert spec.fixed == {"world.clearance": 0.00025, "world.profile": "round", "world.segments": 48}


AWKWARD = [  # text, label, files
    ("v1:peg.skill.json", "v1:peg.skill.json", ["v1:peg.skill.json"]),
    ("C:\\\\peg.skill.json", "C:\\peg.skill.json", ["C:\\peg.skill.json"]),
    ("sub dir/a=b,c.skill.json", "a=b,c.skill.json", ["sub dir/a=b,c.skill.json"]),
    ("lmc:sub dir/a,b.npz,t=1.npz,mode=x", "lmc:a,b.npz,t=1.npz,mode=x", ["sub dir/a,b.npz", "t=1.npz"]),
    ("lmc:t=1.npz,sub dir/x.npz", "lmc:t=1.npz,x.npz", ["t=1.npz", "sub dir/x.npz"]),
    ("lmc:sub dir/t:1.npz,x.npz", "lmc:t:1.npz,x.npz", ["sub dir/t:1.npz", "x.npz"]),
]


@pytest.mark.parametrize(("text", "label", "files"), AWKWARD)
def test_a_campaign_takes_skills_apart_as_run_does_and_so_does_its_folder(tmp_path, text, label, files):
    from campaign_fakes import TEXT

    (tmp_path / "sub dir").mkdir()
    for file in files:
        (tmp_path / file).write_text(file)
    spec = read(write_campaign(tmp_path, text=TEXT.replace('"a.skill.json", "replay:demo.npz"', f'"{text}"')))
    assert spec.labels == (label,)
    assert list(parse_source(spec.skills[0], tmp_path).files) == files
    copy = prepare(spec, tmp_path / "out", lambda spec: {"fixture": []}, FakeParams)
    again = parse_source(copy.skills[0], copy.folder)
    assert [(copy.folder / file).read_text() for file in again.files] == files
    assert (again.kind, again.settings) == parse_source(spec.skills[0], tmp_path)[::2]
    assert copy.labels == (label,)
    for file in again.files:  # a report on a folder without its skills calls them the same
        (copy.folder / file).unlink()
    assert copy.labels == (label,)


def test_fmu_files_beside_a_robot_are_copied_and_named_ones_are_not(campaign, tmp_path):
    path = campaign(trials=4)
    robot, rows = tmp_path / "robots" / "box" / "robot.toml", '[[actuation]]\njoint = "j"\nfmu = "{}"\n'
    (robot.parent / "own.fmu").write_bytes(b"own")
    (robot.parent / "own.ssv").write_bytes(b"own")
    head = 'urdf = "box.urdf"\nparameter_set = "own.ssv"\n'
    robot.write_text(head + rows.format("own.fmu") + rows.format("hydraulic_cylinder"))
    spec = prepare(read(path), tmp_path / "out", lambda spec: {}, FakeParams)
    assert sorted(p.name for p in (spec.folder / spec.robot).parent.iterdir()) == [
        "box.urdf", "own.fmu", "own.ssv", "robot.toml",
    ]  # fmt: skip
    (tmp_path / "far.fmu").write_bytes(b"far")
    robot.write_text('urdf = "box.urdf"\n' + rows.format("../../far.fmu"))
    with pytest.raises(InputError, match="lies outside the robot's folder"):
        prepare(read(path), tmp_path / "again", lambda spec: {}, FakeParams)


def test_a_refused_scene_leaves_no_folder_behind(campaign, tmp_path):
    def refuse(spec):
        raise InputError("world.fake", "clearance is negative")

    path = campaign(trials=4)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match="negative"):
        prepare(read(path), tmp_path / "out", refuse, FakeParams)
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_that_holds_something_is_refused(campaign, tmp_path):
    path = campaign(trials=4)
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").touch()
    with pytest.raises(InputError, match="not an empty folder"):
        prepare(read(path), out, lambda spec: {}, FakeParams)
    (out / "notes.txt").unlink()
    prepare(read(path), out, lambda spec: {}, FakeParams)
    with pytest.raises(InputError, match="campaign resume"):
        prepare(read(path), out, lambda spec: {}, FakeParams)


def test_an_unknown_robot_is_refused_by_name(tmp_path):
    from campaign_fakes import TEXT

    path = write_campaign(tmp_path, text=TEXT.replace("robots/box/robot.toml", "pandda"))
    with pytest.raises(SkillframeError, match="unknown robot 'pandda'"):
        prepare(read(path), tmp_path / "out", lambda spec: {}, FakeParams)


def test_a_missing_campaign_file_is_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "absent.toml")
    with pytest.raises(InputError, match="not a campaign's folder"):
        load(tmp_path, FakeParams)


def test_a_campaign_s_duration_takes_a_unit(tmp_path):
    from campaign_fakes import TEXT

    text = TEXT.replace("duration_s = 5.0", 'duration_s = "1500ms"')
    assert read(write_campaign(tmp_path, text=text)).duration_s == 1.5
