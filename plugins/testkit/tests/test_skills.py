"""The checks have teeth: for every law there is a skill that breaks it, and it is caught for that and nothing else."""

import numpy as np
import pytest
from skillframe_testkit.checks import check_skill
from skillframe_testkit.checks.examples import example_demonstrations, random_observations
from skillframe_testkit.checks.skills import CHECKS
from skillframe_testkit.suites import HoldSkill, SkillConformance

from skillframe.errors import InputError
from skillframe.extend import Illustration, SkillType
from skillframe.frames import Pose
from skillframe.skill import Impedance


class Altered(HoldSkill):
    """Holds, with its command altered by a function of (command, observation, generators)."""

    def __init__(self, alter):
        super().__init__(duration=5.0)
        self.alter = alter

    def start(self, observation, rngs):
        super().start(observation, rngs)
        self.rngs = rngs

    def step(self, observation):
        return self.alter(super().step(observation), observation, self.rngs)


def kind(alter=lambda command, observation, rngs: command, **changes):
    values = {
        "name": "altered", "summary": "holds", "build": lambda document: Altered(alter),
        "describe": lambda document: ["hold"], "example": lambda: {"phases": [{"k": 0.1}]},
    }  # fmt: skip
    return SkillType(**{**values, **changes})


def moved(command, by):
    return command._replace(pose=Pose(command.pose.position + by, command.pose.rotation))


def gains(command, change):
    stiffness = command.impedance.stiffness.copy()
    change(stiffness)
    return command._replace(impedance=Impedance(stiffness))


def with_reason(command, text):
    reason = command.reason.copy()
    reason[:] = text
    return command._replace(reason=reason)


def set_at(array, index, value):
    array[index] = value


def global_chance(command, observation, rngs):
    return moved(command, 1e-9 * np.random.random())  # noqa: NPY002 - the mistake to be caught


BREAKING = {
    "a jump of 1 cm at the start": (lambda c, o, g: moved(c, 0.01), "starts without a bump"),
    "a push of 20 N at the start": (
        lambda c, o, g: c._replace(feedforward=c.feedforward + 20.0),
        "starts without a bump",
    ),
    "a twist without rotation": (lambda c, o, g: c._replace(twist=c.twist[:, :3]), "answers in shape"),
    "a desired pose that is not a number": (lambda c, o, g: moved(c, np.nan), "answers in shape"),
    "a rotation that stretches": (
        lambda c, o, g: c._replace(pose=Pose(c.pose.position, 1.01 * c.pose.rotation)),
        "answers in shape",
    ),
    "gains that are not symmetric": (lambda c, o, g: gains(c, lambda k: set_at(k, (0, 1), 50.0)), "answers in shape"),
    "a stiffness that pushes away": (lambda c, o, g: gains(c, lambda k: set_at(k, (0, 0), -50.0)), "answers in shape"),
    "rows that meet in their mean": (
        lambda c, o, g: moved(c, 1e-3 * (o.wrench[:, :3].mean(0) * o.time[:, None])),
        "rows are independent",
    ),
    "rows that know how many they are": (
        lambda c, o, g: moved(c, 1e-3 * len(o.time) * o.time[:, None]),
        "batched rows equal single trials",
    ),
    "chance that no seed brings back": (
        lambda c, o, g: moved(c, 1e-6 * np.random.default_rng().normal(size=(len(o.time), 3))),
        "repeats with its seed",
    ),
    "chance from the global generator": (global_chance, "repeats with its seed"),
    "writing into the observation": (lambda c, o, g: set_at(o.wrench, 0, 0.0) or c, "answers in shape"),
    "a status that does not exist": (lambda c, o, g: c._replace(status=c.status + 7), "ends with a reason"),
    "a status that is no integer": (lambda c, o, g: c._replace(status=c.status.astype(float)), "ends with a reason"),
    "an end without a reason": (lambda c, o, g: with_reason(c, ""), "ends with a reason"),
    "a reason without an end": (lambda c, o, g: with_reason(c, "on and on"), "ends with a reason"),
}


@pytest.mark.slow
def test_a_skill_that_keeps_the_contract_has_no_problems():
    assert check_skill(kind()) == []


@pytest.mark.slow
@pytest.mark.parametrize("what", BREAKING)
def test_a_skill_that_breaks_a_law_is_caught_by_its_check(what):
    alter, check = BREAKING[what]
    assert any(problem.startswith(f"{check}: ") for problem in check_skill(kind(alter)))


@pytest.mark.slow
def test_chance_from_the_generators_that_are_handed_in_is_allowed():
    def wander(command, observation, rngs):
        return moved(command, 1e-6 * np.stack([rng.normal(size=3) for rng in rngs]))

    assert check_skill(kind(wander)) == []


def changed(document):
    document["phases"] = []
    return HoldSkill()


def refused(document):
    raise InputError("demonstration", "does not suit", "give another")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"build": lambda document: 3}, "builds: build gave int, not a skillframe.Skill"),
        ({"build": changed}, "builds: build changes the document"),
        ({"build": refused}, "builds: raised InputError"),
        ({"example": lambda: {"k": (1, 2)}}, "survives JSON: changes when written as JSON"),
        ({"example": lambda: {"k": float("nan")}}, "survives JSON: raised ValueError"),
        ({"example": lambda: {"k": np.zeros(2)}}, "survives JSON: raised TypeError"),
        ({"example": lambda: 1 / 0}, "no document to try it with: ZeroDivisionError"),
        ({"example": None}, "no document to try it with: InputError"),
        ({"example": None, "learn": lambda d, o: refused(d)}, "give SkillType.example"),
        ({"describe": None}, "says what it does: describe gave []"),
        ({"advice": lambda document: ("sure",)}, "says what it does: advice gave ('sure',)"),
        ({"advice": lambda document: ("sure", "")}, "says what it does: advice gave ('sure', '')"),
        ({"advice": lambda document: ("quite sure", "try it")}, "no problem"),
        ({"describe": lambda document: "hold"}, "no problem"),
        ({"explain": lambda document: [Illustration("t", "c", "<p/>")]}, "'t' is not SVG"),
        ({"explain": lambda document: [Illustration("t", "c", "<svg")]}, "says what it does: raised ParseError"),
    ],
)
def test_a_kind_of_skill_that_is_wrong_is_told_in_words(changes, said):
    problems = check_skill(kind(**changes))
    if said == "no problem":
        assert problems == []
    else:
        assert any(said in problem for problem in problems)


@pytest.mark.slow
def test_pictures_that_are_svg_pass_with_or_without_a_namespace():
    for svg in ("<svg/>", '<svg xmlns="http://www.w3.org/2000/svg"/>'):
        assert check_skill(kind(explain=lambda document, svg=svg: [Illustration("t", "c", svg)])) == []


def test_the_suite_has_a_test_for_every_check():
    tests = {name.removeprefix("test_") for name in dir(SkillConformance) if name.startswith("test_")}
    assert {name.lower().replace(" ", "_") for name in CHECKS} | {"is_discovered"} == tests


def test_example_demonstrations_obey_coulomb_friction_and_repeat():
    first, again = example_demonstrations(), example_demonstrations()
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a.wrench, b.wrench)
        sliding = a.time > 0.5
        velocity = np.gradient(a.position[sliding], a.time[sliding], axis=0)
        power = (a.wrench[sliding, :3] * velocity).sum(1)
        # -mu N v = -0.2 * 8 N * 0.03 m/s; the noise of 400 samples averages to 0.05 * 0.03 / 20
        np.testing.assert_allclose(power.mean(), -0.048, atol=5e-4)


def test_random_observations_start_at_rest_and_cannot_be_written_to():
    observations = random_observations(np.random.default_rng(0), 4, 3, 0.1)
    assert not np.any(observations[0].twist)
    assert [o.time.tolist() for o in observations] == [[0.0] * 4, [0.1] * 4, [0.2] * 4]
    with pytest.raises(ValueError, match="read-only"):
        observations[1].pose.position[0] = 0.0
