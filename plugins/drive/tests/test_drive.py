"""Skills through a link to a fake arm in the same process: the loop, the drives and their guards, without sockets."""

from __future__ import annotations

import io
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from direct_link import DirectLink, arm
from skillframe_drive.cell import Cell
from skillframe_drive.fake import FakeArm
from skillframe_drive.press import PRESSES, check_wrench, judged
from skillframe_drive.real import MOST_MISSED
from skillframe_drive.runs import Slowed, check, load_task, run_once

from skillframe.api.learning import skill_of
from skillframe.errors import SkillframeError
from skillframe.execution.drives.torque import HOLD
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import LinkType
from skillframe.extend.registry import registry
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Command, Observation, Skill, no_reasons
from skillframe.world.quantities import SensorSettings

NOISES = [field.name for field in fields(SensorSettings)]
LINKS = {"ur5e": ("position", 0.002), "fr3": ("torque", 0.001)}


@pytest.fixture(autouse=True)
def two_links(monkeypatch):
    """Links that are opened by the tests themselves."""
    kinds = {"direct_position": "position", "direct_torque": "torque"}
    records = {
        name: LinkType(name=name, summary="", takes=takes, open=lambda host: pytest.fail("not opened here"))
        for name, takes in kinds.items()
    }
    found = registry()
    real = found.record
    monkeypatch.setattr(found, "record", lambda kind, name: records.get(name) or real(kind, name))


def cell(robot: str, **changes: object) -> Cell:
    return Cell(
        robot=robot, link=f"direct_{LINKS[robot][0]}", host="", **{"world": "valley", "witness": "pose", **changes}
    )


def linked(robot: str, fake: FakeArm) -> DirectLink:
    return DirectLink(fake, *LINKS[robot])


def tried(skill, robot, link, *, duration_s=20.0, done=None, dry=False, slow=1.0, **changes):
    task = load_task(cell(robot, **changes))
    return run_once(
        skill_of(skill), task, link, coc=None, slow=slow, dry=dry, duration_s=duration_s, rate_hz=100.0, done=done
    )


@pytest.mark.parametrize("robot", LINKS)
@pytest.mark.slow
def test_without_noise_a_robot_does_what_its_simulation_does(valley_skill, robot):
    """Same controller, same physics: only the order of reading, sending and stepping could make a difference."""
    model, scene = load_robot_model(robot), load_world("valley", {})
    runnable, setup = prepare(model, scene, skill_of(valley_skill).document)
    still = replace(setup, sensors=SensorSettings(**dict.fromkeys(NOISES, 0.0)))
    simulated = simulate(runnable, still, {}, [np.random.default_rng(0)], duration_s=1.0, trace_hz=100.0)
    fake = arm(robot, noise=0.0, bias=0.0)
    run = tried(valley_skill, robot, linked(robot, fake), duration_s=1.0)
    expected, found = simulated.traces[0], run.trace
    within = {"fr3": 1e-5, "ur5e": 1e-3}[robot]  # a position is sent to a loop of 1 kHz at 500 Hz
    assert np.ptp(expected.position, axis=0).max() > 0.003
    assert np.abs(found.position - expected.position[: len(found.position)]).max() < within


@pytest.mark.slow
def test_a_skill_runs_by_torque_to_its_goal(valley_skill):
    fake = arm("fr3")
    link = linked("fr3", fake)
    run = tried(valley_skill, "fr3", link)
    assert run.success and fake.ground().goal
    assert link.log == ["tare", "arm", "halt"] and link.sent > 1000
    assert 0.4 < run.trace.meta["sensor_noise_n"] < 0.65  # 0.3 N in each of three axes
    assert run.trace.meta["source"] == "real" and run.trace.meta["link"] == "direct_torque"


@pytest.mark.slow
def test_a_fixture_that_is_not_where_it_is_believed_is_reached_and_the_person_says_so(valley_skill):
    truth = {"fixture__offset_x": 0.008, "start__offset_z": 0.012}
    fake = arm("fr3", **truth)
    run = tried(valley_skill, "fr3", linked("fr3", fake), witness="person", done=lambda: True)
    assert fake.ground().goal and run.success
    unseen = tried(valley_skill, "fr3", linked("fr3", arm("fr3", **truth)))
    assert not unseen.success  # the pose is 8 mm from the believed goal
    believed = tried(valley_skill, "fr3", linked("fr3", arm("fr3", **truth)), believed={"fixture.offset_x": "8mm"})
    assert believed.success


@pytest.mark.slow
def test_a_person_who_says_no_is_a_failure(valley_skill):
    run = tried(valley_skill, "fr3", linked("fr3", arm("fr3")), done=lambda: False)
    assert not run.success and "person" in run.failure


@pytest.mark.slow
def test_a_dry_run_sends_nothing(valley_skill):
    link = linked("fr3", arm("fr3"))
    run = tried(valley_skill, "fr3", link, dry=True, duration_s=0.2)
    assert link.sent == 0 and link.log == ["tare"] and run.trace.meta["dry"]


def test_a_robot_that_moves_while_its_sensor_is_zeroed_is_not_sent_anything(valley_skill):
    link = linked("ur5e", arm("ur5e"))
    link.push = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    run = tried(valley_skill, "ur5e", link)
    assert "moved by" in run.failure and run.trace.meta["ended_by"] == "link"
    assert link.sent == 0 and link.log == ["tare"]


@pytest.mark.slow
def test_a_fault_of_the_link_ends_the_run_and_calls_nothing_after_it(valley_skill):
    link = linked("fr3", arm("fr3"))
    link.fault_after = 0.5
    run = tried(valley_skill, "fr3", link)
    assert run.failure.startswith("planted") and run.trace.meta["ended_by"] == "link"
    assert link.log == ["tare", "arm"]


def test_lost_states_end_the_run(valley_skill):
    link = linked("fr3", arm("fr3"))
    link.missed = MOST_MISSED + 1
    run = tried(valley_skill, "fr3", link)
    assert "states of the robot were lost" in run.failure and link.log[-1] == "halt"


@pytest.mark.slow
def test_a_turned_sign_of_the_wrench_runs_into_the_force_limit_of_the_cell(valley_skill):
    fake = arm("fr3")
    link = linked("fr3", fake)
    read = link.read
    link.read = lambda: (state := read())._replace(wrench=-state.wrench)
    run = tried(valley_skill, "fr3", link, force_n=15.0)
    assert not run.success and run.trace.meta["ended_by"] in ("force", "true_force", "diverged")
    assert run.trace.meta["limits"]["force_n"] == 15.0
    assert "simulator" not in run.failure


def test_a_bias_of_the_sensor_is_zeroed_before_the_skill_starts(valley_skill):
    fake = arm("fr3", noise=0.0, bias=0.0)
    link = linked("fr3", fake)
    read, off = link.read, np.array([5.0, -3.0, 2.0, 0.2, 0.1, -0.1])
    link.read = lambda: (state := read())._replace(wrench=state.wrench + off)
    run = tried(valley_skill, "fr3", link, duration_s=0.05)
    assert np.abs(run.trace.wrench).max() < 0.2 and np.abs(run.trace.wrench_true).max() < 0.2


def test_a_slowed_skill_feeds_the_slowed_speed_forward():
    """A skill that moves at 20 mm/s, seen on a clock that runs at half the speed."""

    class Moves(Skill):
        def start(self, observation, rngs):
            pass

        def step(self, observation):
            self.seen = observation
            twist = np.tile([0.02, 0.0, 0.0, 0.0, 0.0, 0.0], (1, 1))
            still = np.zeros((1, 6))
            return Command(observation.pose, twist, HOLD, still, np.zeros(1, dtype=np.int64), no_reasons(1))

    inner, at = Moves(), Pose(np.zeros((1, 3)), np.eye(3)[None])
    slowed = Slowed(inner, 1, 2.0)
    command = slowed.step(Observation(np.array([1.0]), 0.002, at, np.full((1, 6), 0.01), np.zeros((1, 6))))
    assert command.twist[0, 0] == pytest.approx(0.01)
    assert inner.seen.time[0] == 0.5 and inner.seen.dt == 0.001 and inner.seen.twist[0, 0] == pytest.approx(0.02)


@pytest.mark.slow
def test_half_the_speed_takes_longer(valley_skill):
    whole = tried(valley_skill, "fr3", linked("fr3", arm("fr3")))
    half = tried(valley_skill, "fr3", linked("fr3", arm("fr3")), slow=0.5)
    assert half.success and half.duration_s > 1.3 * whole.duration_s


def test_a_check_measures_clock_rest_start_and_noise():
    lines = check(load_task(cell("fr3")), linked("fr3", arm("fr3", noise=0.5)))
    assert not any(line.problem for line in lines)
    assert lines[0].text == "1000 states a second" and "noise of 0.5" in lines[3].text


@pytest.mark.parametrize(
    ("plant", "problem"),
    [
        (lambda link: setattr(link, "period", 0.004), "the link expects 250"),
        (lambda link: setattr(link, "push", np.full(6, 0.05)), "the robot moves"),
        (lambda link: setattr(link.arm_, "target", link.arm_.target + 0.1), "move the robot to its start"),
        (lambda link: setattr(link, "fault_after", 0.1), "planted"),
    ],
)
@pytest.mark.slow
def test_a_check_finds(plant, problem):
    link = linked("ur5e", arm("ur5e"))
    clock = link.period
    plant(link)
    if link.period != clock:  # the robot's clock is another one than the link expects
        link.period, expected = clock, link.period
        read = link.read
        link.read = lambda: (link.__dict__.update(period=clock), read(), link.__dict__.update(period=expected))[1]
    else:
        for _ in range(500):
            if link.fault_after is None:
                link.read()
    assert any(problem in line.problem for line in check(load_task(cell("ur5e")), link))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"link": "direct_position"}, "takes a joint position"),
        ({"believed": {"start.offset_x": 0.01}}, "is no place of the fixture"),
        ({"believed": {"fixture.offset_x": "8 kg"}}, "kg"),
        ({"link": "directx"}, "unknown link 'directx'"),
        ({"robot": "fr4"}, "did you mean 'fr3'"),
        ({"world": "vally"}, "did you mean 'valley'"),
    ],
)
def test_a_cell_is_refused(changes, sentence):
    with pytest.raises(SkillframeError, match=sentence):
        load_task(Cell(**{**vars_of(cell("fr3")), **changes}))


def vars_of(value: Cell) -> dict:
    return {name: getattr(value, name) for name in Cell.__dataclass_fields__}


def test_the_command_line_refuses_what_it_cannot_use(tmp_path, capsys, valley_skill):
    from skillframe.cli.main import run

    written = tmp_path / "cell.toml"
    written.write_text('robot = "fr3"\nlink = "direct_torque"\nhost = "h"\nworld = "valley"\nspeed = 3\n')
    for words, sentence in (
        (["drive", "check", str(tmp_path / "none.toml")], "no such file"),
        (["drive", "check", str(written)], "speed"),
        (["drive", "fake", "ur", "--world", "valley", "--host", "0.0.0.0"], "loopback"),
        (["drive", "fake", "ur", "--world", "valley", "--host", "here"], "loopback"),
        (["drive", "fake", "ur", "--world", "valley", "--fault", "cat=1"], "did you mean 'cut'"),
        (["drive", "fake", "ur", "--world", "valley", "--fault", "cut=soon"], "give a number"),
        (["drive", "fake", "ur", "--world", "valley", "--robot", "panda"], "ur robots take a joint position"),
        (["drive", "fake", "direct_torque", "--world", "valley"], "has no fake robot"),
    ):
        capsys.readouterr()
        assert run(words) == 2
        said = capsys.readouterr().err
        assert sentence in said and said.count("error") == 1, said


def test_a_run_is_entered_as_the_next_real_trial(valley_skill, tmp_path, monkeypatch, capsys):
    from skillframe.cli.main import run

    written, bench = tmp_path / "cell.toml", tmp_path / "bench"
    written.write_text('robot = "fr3"\nlink = "direct_torque"\nhost = "h"\nworld = "valley"\nwitness = "person"\n')
    monkeypatch.setattr("skillframe_drive.runs.open_link", lambda cell: linked("fr3", arm("fr3")))
    words = ["drive", "run", str(valley_skill), "--cell", str(written), "--duration", "0.2", "--enter", str(bench)]
    refused = "slowed run is no trial"
    for more, sentence in ((["--dry"], refused), (["--slow", "0.5"], refused), ([], "not confirmed")):
        monkeypatch.setattr("sys.stdin", io.StringIO("no\n"))
        assert run([*words, *more]) == 2 and sentence in capsys.readouterr().err
    assert run([*words[:-2], "--samples", "a=1"]) == 2 and "--enter TABLE" in capsys.readouterr().err
    assert not bench.exists()
    for answer, code, offset in (("y", 0, "0"), ("n", 1, "0.004")):
        monkeypatch.setattr("sys.stdin", io.StringIO(f"move\n{answer}\n"))
        assert run([*words, "--samples", f"fixture.offset_x={offset}"]) == code
    rows = (bench / "results.csv").read_text().splitlines()
    assert rows[0] == "trial,skill,success,failure,fixture.offset_x,source"
    assert rows[1:] == ["0,valley,1,,0.0,real", "1,valley,0,the person says that it is not done,0.004,real"]
    monkeypatch.setattr("sys.stdin", io.StringIO("move\ny\n"))
    assert run([*words, "--samples", "offset=1"]) == 2  # other samples than the table's
    assert (
        f"type: skillframe trials enter {bench} --skill valley --success --samples offset=1" in capsys.readouterr().err
    )
    assert len((bench / "results.csv").read_text().splitlines()) == 3


def test_without_the_command_trials_a_run_that_is_to_be_entered_does_not_begin(valley_skill, monkeypatch, capsys):
    from skillframe.cli.main import cli, run

    real = cli.get_command
    monkeypatch.setattr(cli, "get_command", lambda ctx, name: None if name == "trials" else real(ctx, name))
    assert run(["drive", "run", str(valley_skill), "--cell", "none.toml", "--enter", "bench"]) == 2
    assert "install skillframe-certify" in capsys.readouterr().err


def test_a_cell_file_is_read(tmp_path):
    from skillframe_drive.cell import load_cell

    written = tmp_path / "cell.toml"
    text = 'robot = "fr3"\nlink = "franka"\nhost = "10.0.0.2"\nworld = "valley"\nforce_n = 30\n[believed]\n'
    written.write_text(text + '"fixture.offset_x" = "8 mm"\n')
    found = load_cell(written)
    assert found.believed == {"fixture.offset_x": "8 mm"} and found.force_n == 30 and found.witness == "person"
    assert json.dumps(found.host) == '"10.0.0.2"'


def test_the_forces_of_a_real_run_are_said_to_be_its_sensor_s():
    from skillframe.execution.result import peak_forces

    assert peak_forces({"peak_force_n": 12.3, "source": "real"}, "{:.0f}".format) == [
        "peak contact force at the sensor 12 N"
    ]
    assert peak_forces({"peak_force_n": 12.3}, "{:.0f}".format) == ["peak contact force in simulation 12 N"]


def pressed_wrench(robot, spoil, forces=([0.0, 0.0, -20.0], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0])):
    """What the check of the wrench says when a person presses `forces`, and `spoil` changes what is read."""
    fake = arm(robot)
    link = linked(robot, fake)
    read, given = link.read, iter(forces)

    def released():
        state = read()
        if link.time > fake.let_go:
            fake.pressed[:] = 0.0
        return state._replace(wrench=spoil(state.wrench, fake))

    def pressing(text):
        fake.pressed[:], fake.let_go = next(given), link.time + 0.6

    fake.let_go, link.read = np.inf, released
    return check_wrench(load_task(cell(robot)), link, pressing).problem


def in_axes(wrench, rotation):
    return np.concatenate([wrench[:3] @ rotation, wrench[3:] @ rotation])


def at_tip(wrench, fake):
    moved = wrench.copy()
    moved[3:] -= np.cross(fake.pose.rotation[0] @ fake.tip, wrench[:3])
    return moved


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda wrench, fake: wrench, ""),
        (lambda wrench, fake: -wrench, "its sign is wrong"),
        (lambda wrench, fake: in_axes(wrench, fake.pose.rotation[0]), "in the tool's axes and not"),
        (lambda wrench, fake: -in_axes(wrench, fake.pose.rotation[0]), "in the tool's axes, with the wrong sign"),
        (lambda wrench, fake: in_axes(wrench, np.diag([-1.0, -1.0, 1.0])), "turned by 180 degrees about z"),
        (lambda wrench, fake: wrench[[1, 2, 0, 4, 5, 3]], "were read along"),
        (at_tip, "taken at the tool's tip"),
        (lambda wrench, fake: wrench * [1, 1, 1, -1, -1, -1], "the sign of its torque is wrong"),
    ],
)
@pytest.mark.slow
def test_three_presses_name_what_is_wrong_with_the_wrench(spoil, sentence):
    problem = pressed_wrench("ur5e", spoil)
    assert problem.startswith(sentence) if sentence == "" else sentence in problem
    assert bool(problem) == bool(sentence)


@pytest.mark.slow
def test_a_press_that_does_not_come_is_said():
    assert "no press above 8 N" in pressed_wrench("ur5e", lambda wrench, fake: wrench, ([0.0] * 3,))


def test_a_wrench_in_axes_of_a_slanted_tool_is_told_from_a_slanted_press():
    rotation = rotation_matrix(np.array([[2.0, 1.2, 0.4]]))[0]
    lever = rotation @ [0.0, 0.0, 0.2]
    forces = 20.0 * np.array(list(PRESSES.values()))
    read = np.hstack([forces, np.cross(lever, forces)])
    tool_axes = np.hstack([forces @ rotation, np.cross(lever, forces) @ rotation])
    slanted = 20.0 * np.array([[0.3, 0.3, -0.9], [0.9, 0.3, 0.3], [0.3, 0.9, 0.3]])  # by 25 degrees
    assert judged(read, rotation, lever) == ""
    assert judged(np.hstack([slanted, np.cross(lever, slanted)]), rotation, lever) == ""
    assert "in the tool's axes and not" in judged(tool_axes, rotation, lever)
