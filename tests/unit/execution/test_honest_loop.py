"""What a skill does to its observation, and hands back that is no command, changes nothing of what it is judged by."""

from dataclasses import replace

import numpy as np
import pytest

from skillframe.errors import SkillframeError
from skillframe.frames import Pose, norm
from skillframe.robot.spec import Limits
from skillframe.sequence import Part, Sequence
from skillframe.skill import Command, Status, per_trial
from skillframe.world.scene import Holder
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

VALLEY = impedance(free_axes="x")
DOWN = (0.0, 0.0, -1.0)
SOFT = np.diag([1000.0] * 3 + [20.0] * 3)


def pressed(limit=30.0, **options):
    """A ball pressed onto the valley's bottom, under a limit."""
    return setup(limits=Limits(force_n=limit, torque_rate_nm_s=None), **options)


class Presser(Push):
    """Leads the tool by a spring force of 60 N, twice the limit, at a speed that makes no impact."""

    def __init__(self):
        super().__init__(DOWN, VALLEY, speed=0.02, cap=60.0, stall=False)


class Blinder(Presser):
    """Sets all that it is shown to zero, by every way that numpy offers."""

    def step(self, observation):
        command = super().step(observation)
        for array in (observation.wrench, observation.twist, observation.time, *observation.pose):
            while array is not None:
                try:
                    array.flags.writeable = True
                    array[...] = 0.0
                except ValueError:
                    pass
                array = array.base
        return command


class Writer(Presser):
    def step(self, observation):
        observation.wrench[...] = 0.0
        return super().step(observation)


def test_a_skill_cannot_switch_a_limit_off_by_writing_into_what_it_is_shown():
    honest = run(Presser(), pressed(), duration_s=4.0, trace_hz=1000)
    blind = run(Blinder(), pressed(), duration_s=4.0, trace_hz=1000)
    assert honest.reason[0].startswith("force limit")
    assert list(blind.reason) == list(honest.reason)
    assert blind.peak_force_n[0] == honest.peak_force_n[0]
    for name in ("position", "twist", "wrench", "command_wrench"):  # nor change what is recorded or controlled by
        np.testing.assert_array_equal(getattr(blind.traces[0], name), getattr(honest.traces[0], name))


@pytest.mark.parametrize("wrap", [lambda make: make(), per_trial, lambda make: Sequence([Part("one", make)])])
def test_a_skill_that_writes_into_its_observation_is_refused_by_name(wrap):
    with pytest.raises(SkillframeError, match="writes into its observation"):
        run(wrap(Writer), pressed(), duration_s=0.1)


def test_the_second_of_two_skills_in_a_sequence_cannot_switch_a_limit_off():
    first = Part("wait", lambda: Hold(VALLEY, end=(0.05, Status.SUCCESS, "waited")))
    result = run(Sequence([first, Part("press", Blinder)]), pressed(), duration_s=4.0)
    assert result.reason[0].startswith("force limit")


# --- what is handed back ---


class Odd(Hold):
    """Holds still, and changes its command by a function, from 0.1 s on."""

    def __init__(self, change, stiffness=SOFT, damping=None):
        super().__init__(stiffness, damping=damping)
        self.change = change

    def step(self, observation):
        command = super().step(observation)
        return self.change(command) if observation.time[0] > 0.0955 else command


def odd(change, count=3, **options):
    return run(Odd(change, **options), setup(world="free"), count=count, duration_s=0.2)


def replaced(field, value):
    def change(command):
        if field in ("position", "rotation"):
            return command._replace(pose=command.pose._replace(**{field: value(getattr(command.pose, field))}))
        if field in ("stiffness", "damping"):
            gains = command.impedance
            return command._replace(impedance=gains._replace(**{field: value(getattr(gains, field))}))
        return command._replace(**{field: value(getattr(command, field))})

    return change


@pytest.mark.parametrize(
    "field", ["position", "rotation", "twist", "feedforward", "status", "reason"]
)  # fmt: skip
def test_one_row_for_all_trials_is_the_skill_s_defect_and_not_broadcast(field):
    with pytest.raises(SkillframeError, match=rf"skill Odd: .*{field} has the shape .*and not \(3"):
        odd(replaced(field, lambda array: array[:1]))


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("position", lambda a: a.tolist(), "position is a list"),
        ("twist", lambda a: None, "twist is nothing"),
        ("status", lambda a: a.astype(float), "status is an array of float64"),
        ("reason", lambda a: np.zeros(len(a)), "reason is an array of float64"),
        ("stiffness", lambda a: a[:3, :3], "stiffness has the shape"),
    ],
)
def test_what_is_no_array_of_the_right_kind_is_refused_with_its_field(field, value, text):
    with pytest.raises(SkillframeError, match=text):
        odd(replaced(field, value))


def test_what_is_no_command_is_refused():
    with pytest.raises(SkillframeError, match="hands back nothing"):
        odd(lambda command: None)


def first_row(value):
    def change(array):
        changed = np.array(array)
        changed[0] = value(changed[0])
        return changed

    return change


def of_all(matrix):
    return np.tile(matrix, (3, 1, 1))


BAD_ROWS = [
    ("rotation", first_row(lambda r: 3.0 * r), {}, "rotation is none"),
    ("rotation", first_row(lambda r: r * [1.0, 1.0, -1.0]), {}, "rotation is none"),
    ("rotation", first_row(lambda r: r @ [[1.5, 0, 0], [0, 1, 0], [0, 0, 0.5]]), {}, "rotation is none"),
    ("stiffness", first_row(lambda k: -k), {"stiffness": of_all(SOFT)}, "stiffness is not symmetric"),
    ("stiffness", first_row(lambda k: k + np.eye(6, k=1) * 500.0), {"stiffness": of_all(SOFT)}, "stiffness is not"),
    ("damping", first_row(lambda d: -d), {"stiffness": of_all(SOFT), "damping": of_all(0.1 * SOFT)}, "feed energy"),
    ("status", first_row(lambda s: 99), {}, "status is 99"),
    ("status", first_row(lambda s: -1), {}, "status is -1"),
]  # fmt: skip


@pytest.mark.parametrize(("field", "value", "options", "text"), BAD_ROWS)
def test_a_row_that_is_no_command_ends_its_trial_with_words_and_leaves_its_neighbours_alone(
    field, value, options, text
):
    result = odd(replaced(field, value), **options)
    assert list(result.success) == [False, True, True]
    assert text in result.failure[0]
    assert result.ended_by[0] == "command"
    assert result.duration_s[0] < 0.12
    alone = run(Odd(lambda c: c, **{k: v[:1] if v.ndim == 3 else v for k, v in options.items()}), setup(world="free"),
                duration_s=0.2)  # fmt: skip
    assert result.final_error_m[1] == alone.final_error_m[0]


def test_an_unknown_status_is_no_success_at_the_goal():
    result = run(Hold(SOFT, end=(0.05, 99, "done")), setup(world="free"), duration_s=0.1)
    assert not result.success[0]
    assert result.failure[0].startswith("the skill's status is 99, which is none of 0 (running)")


def test_a_reason_that_is_no_text_is_the_skill_s_failure():
    result = run(Hold(SOFT, end=(0.05, Status.SUCCESS, 3)), setup(world="free"), duration_s=0.1)
    assert result.failure[0].startswith("the skill's reason is 3, and no text")


def test_a_stiffness_changed_in_place_after_it_was_checked_is_found_within_ten_ticks():
    def change(command):
        np.multiply(command.impedance.stiffness, -1.0 if command.impedance.stiffness[0, 0] > 0.0 else 1.0,
                    out=command.impedance.stiffness)  # fmt: skip
        return command

    result = odd(change, count=1, stiffness=SOFT.copy())
    assert "stiffness is not symmetric" in result.failure[0]
    assert result.duration_s[0] <= 0.106


def test_a_part_of_a_sequence_that_answers_for_no_trial_is_refused():
    part = Part("odd", lambda: Odd(replaced("position", lambda array: array[:0])))
    with pytest.raises(SkillframeError, match="position has the shape"):
        run(Sequence([part]), setup(world="free"), count=3, duration_s=0.2)


def two_arms(points):
    """A peg over a hole in the second arm's grip."""
    now = setup("dual_panda", "peg_in_hole", points)
    held = replace(now.scene, holder=Holder(tool=now.scene.tool, position=(0.0, 0.0, 0.15)))
    return replace(now, scene=held)


def test_the_skill_of_one_arm_that_answers_with_one_row_is_refused_on_a_robot_with_two():
    skill = Odd(replaced("twist", lambda array: array[:1]))
    with pytest.raises(SkillframeError, match=r"twist has the shape \(1, 6\), and not \(2, 6\)"):
        run(skill, two_arms(np.zeros(3)), count=2, duration_s=0.12)


class Coordinator(Hold):
    """Two arms, each held where it is. Returns what a function makes of the command."""

    def __init__(self, change):
        super().__init__(np.diag([2000.0] * 3 + [100.0] * 3))
        self.change = change

    def step(self, observation):
        count, arms = observation.time.shape
        zero = np.zeros((count, arms, 6))
        command = Command(
            Pose(*self.pose), zero, self.impedance, zero, np.zeros(count, dtype=int), np.full(count, "", dtype=object)
        )
        return self.change(command)


def test_a_coordinator_s_command_is_checked_as_any_other():
    now = two_arms(np.zeros((2, 3)))
    with pytest.raises(SkillframeError, match=r"twist has the shape \(2, 1, 6\), and not \(2, 2, 6\)"):
        run(Coordinator(replaced("twist", lambda array: array[:, :1])), now, count=2, duration_s=0.05)
    scaled = run(Coordinator(replaced("rotation", first_row(lambda r: 3.0 * r))), now, count=2, duration_s=0.05)
    assert list(scaled.ended_by) == ["command", "time"]


def test_a_skill_may_keep_what_it_is_shown():
    seen = []

    class Keeper(Push):
        def step(self, observation):
            seen.append(observation.pose.position)
            return super().step(observation)

    result = run(Keeper(DOWN, VALLEY), setup(), duration_s=0.05, trace_hz=1000)
    np.testing.assert_array_equal(np.concatenate(seen), result.traces[0].position)
    assert norm(seen[0] - seen[-1]).max() > 0.0
