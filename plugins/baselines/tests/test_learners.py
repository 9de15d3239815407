"""`dmp`, `gmr` and `seds`: their own laws, and what they share."""

import copy
import json
from functools import cache

import numpy as np
import pytest
from skillframe_baselines import align, gmm, seds
from skillframe_baselines.dmp import STEP
from skillframe_baselines.dynamics import SLOWEST, Dynamics, Flow
from skillframe_testkit.suites import SkillConformance, play

from plugins.baselines.tests.demonstrations import GOAL, UPSIDE, approach, both_sides
from skillframe.document.file import learned
from skillframe.errors import InputError, MissingDependency
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Pose, norm, rotation_matrix, rotation_vector
from skillframe.skill import Observation, Status

KINDS = ("dmp", "gmr", "seds")
pytest.importorskip("movement_primitives", reason="movement_primitives is not installed (skillframe-baselines[dmp])")


class TestDmpConforms(SkillConformance):
    skill_type = "dmp"


@pytest.mark.slow  # the same law with other numbers
class TestLearnedDmpConforms(SkillConformance):
    skill_type = "dmp"

    @property
    def document(self):
        return once("dmp")


def learn(kind, demonstrations=None, at=None, axes="base", **settings):
    options = LearnOptions(at=at, axes=axes, settings=settings)
    return learned(registry().skill(kind), demonstrations or both_sides(), options)


@cache
def once(kind):
    return learn(kind)


@pytest.fixture(scope="module")
def documents():
    return {kind: once(kind) for kind in KINDS}


def still(pose, times):
    zero = np.zeros((1, 6))
    there = Pose(pose.position[None], pose.rotation[None])
    return [Observation(np.array([t]), 1e-3, there, zero, zero) for t in times]


def commands(document, start, times):
    return play(registry().skill(document["type"]).build(document), still(start, times), [0])


def start_of(demonstration):
    return Pose(demonstration.pose.position[0], demonstration.pose.rotation[0])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.slow
def test_from_a_demonstrated_start_it_ends_at_the_demonstrated_goal(documents, kind, side):
    times = np.arange(0.0, 25.0, 0.05)
    played = commands(documents[kind], start_of(approach(side)), times)
    last = played[-1].pose
    # a spring that settles, a mean of a mixture and an exponential approach: 2 mm and 1 degree of 50 mm and 11 degrees
    assert norm(last.position[0] - GOAL) < 2e-3
    assert norm(rotation_vector(last.rotation[0] @ rotation_matrix(UPSIDE).T)) < np.deg2rad(1.0)
    assert played[-1].status[0] == Status.SUCCESS and played[-1].reason[0]


@pytest.mark.parametrize("kind", KINDS)
def test_it_moves_as_fast_as_it_says(documents, kind):
    h = 1e-4
    for t in (0.2003, 0.7013, 1.1013):  # between samples, where the derivative exists
        _, before, at, after = commands(documents[kind], start_of(approach(1.0)), [0.0, t - h, t, t + h])
        velocity = (after.pose.position[0] - before.pose.position[0]) / (2 * h)
        turning = rotation_vector(after.pose.rotation[0] @ before.pose.rotation[0].T) / (2 * h)
        # a second derivative below 0.5 m/s^2 over 0.1 ms, and second-order steps: 1e-4 of a speed of some 0.05
        np.testing.assert_allclose(at.twist[0], np.concatenate([velocity, turning]), atol=3e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_at_another_centre_of_compliance_the_tool_moves_the_same(documents, kind):
    offset, times, start = np.array([0.03, -0.02, 0.15]), [0.0, 0.4, 1.0, 2.0], start_of(approach(1.0))
    document = copy.deepcopy(documents[kind])
    document["phases"][0]["blend"] = 1e-3  # the start's error is blended away at the centre of compliance, see replay
    other = {**document, "frame": {**document["frame"], "center_of_compliance": offset.tolist()}}
    for one, two in zip(commands(document, start, times), commands(other, start.at(offset), times), strict=True):
        back = two.pose.at(-offset)
        # points between samples go along chords: 0.15 m * (2e-3 rad)^2 / 8 is below 0.1 um
        np.testing.assert_allclose(back.position, one.pose.position, atol=2e-6)
        np.testing.assert_allclose(back.rotation, one.pose.rotation, atol=1e-9)


@pytest.mark.parametrize("kind", ["dmp", "gmr"])
def test_the_wrench_profile_is_what_the_person_s_tool_exerted(documents, kind):
    late = commands(documents[kind], start_of(approach(1.0)), [0.0, 2.2])[-1]
    assert late.feedforward[0, 2] == pytest.approx(-8.0, abs=0.5)  # robot on environment; a profile of 25 functions
    fewest = {"most_components": 5} if kind == "gmr" else {}  # the wrench is left out whatever the mixture
    quiet = learn(kind, feedforward=False, **fewest)
    assert not np.any(commands(quiet, start_of(approach(1.0)), [0.0, 2.2])[-1].feedforward)


@pytest.mark.parametrize("kind", KINDS)
def test_a_skill_file_carries_what_was_learned(documents, kind, tmp_path):
    from skillframe.document.file import load, save

    save(documents[kind], tmp_path / "x.skill.json")
    back, start = load(tmp_path / "x.skill.json"), start_of(approach(-1.0))
    assert json.dumps(back, sort_keys=True) == json.dumps(documents[kind], sort_keys=True)
    for one, two in zip(*(commands(d, start, [0.0, 0.5, 1.5]) for d in (back, documents[kind])), strict=True):
        np.testing.assert_array_equal(one.pose.position, two.pose.position)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_learning_twice_gives_the_same_numbers(documents, kind):
    assert learn(kind)["model"] == documents[kind]["model"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"stifness": 1.0}, "stiffness"),
        ({"stiffness_rotation": 0.0}, "must be positive"),
        ({"blend": -1.0}, "must be positive"),
        ({"feedforward": "yes"}, "expected true or false"),
    ],
)
def test_settings_that_make_no_sense_are_refused(kind, settings, said):
    with pytest.raises(InputError, match=said):
        learn(kind, **settings)


@pytest.mark.parametrize("kind", KINDS)
def test_axes_of_the_start_and_no_demonstration_are_refused(kind):
    with pytest.raises(InputError, match="base axes"):
        learn(kind, axes="phase_start")
    with pytest.raises(InputError, match="no demonstration given"):
        registry().skill(kind).learn([], LearnOptions())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("model"), "model"),
        (lambda d: d["model"].pop("goal_position"), "goal_position"),
        (lambda d: d["model"].update(goal_position=[0.0, "x", 1.0]), "goal_position"),
        (lambda d: d["phases"].clear(), "one phase, got 0"),
        (lambda d: d["phases"][0].update(name="replay"), "replay"),
        (lambda d: d["phases"][0]["stiffness"].update(rotation=-1.0), "must be positive"),
    ],
)
def test_a_damaged_document_is_refused_by_its_key(documents, kind, change, said):
    document = copy.deepcopy(documents[kind])
    change(document)
    with pytest.raises(InputError, match=said):
        registry().skill(kind).check(document)


@pytest.mark.parametrize(("kind", "hidden"), [("dmp", ["movement_primitives.dmp"]), ("seds", ["casadi"])])
def test_without_its_library_a_skill_says_what_to_type_and_still_runs(documents, monkeypatch, kind, hidden):
    import sys

    for module in hidden:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "skillframe_baselines.seds_fit", raising=False)
    with pytest.raises(MissingDependency, match=rf"pip install 'skillframe-baselines\[{kind}\]'"):
        learn(kind)
    assert commands(documents[kind], start_of(approach(1.0)), [0.0, 0.1])


def test_the_rollout_is_the_librarys(documents):
    from movement_primitives.dmp import DMP

    model = documents["dmp"]["model"]
    fine = STEP / 5
    primitive = DMP(6, execution_time=model["tau"], dt=fine, n_weights_per_dim=len(model["centers"]))
    primitive.forcing_term.weights_ = np.array(model["weights"])
    start = np.array([0.03, -0.01, 0.06, 0.02, 0.15, -0.05])
    primitive.configure(start_y=start, goal_y=np.zeros(6))
    times, theirs = primitive.open_loop(run_t=model["tau"])
    ours = registry().skill("dmp").build(documents["dmp"]).rollout(start[None])[:, 0]
    ours = ours[: len(theirs[::5])]
    np.testing.assert_allclose(times[::5][: len(ours)], STEP * np.arange(len(ours)), atol=1e-9)
    # the library takes the forcing of a step at its end: at 0.1 m/s^2 or less over steps of 1 ms, 5e-5 in all
    np.testing.assert_allclose(ours, theirs[::5], atol=5e-5)


def test_averaged_weights_are_the_regression_on_all_demonstrations():
    one, two = approach(1.0), approach(-1.0)
    apart = [np.array(learn("dmp", [demo])["model"]["weights"]) for demo in (one, two)]
    together = np.array(learn("dmp", [one, two])["model"]["weights"])
    # x and the tilt cancel, z is common; alignment moves samples by up to 40 ms
    scale = np.abs(apart[0]).max()
    assert np.abs(together - np.mean(apart, axis=0)).max() < 0.05 * scale


def test_a_mixture_of_two_clouds_is_found_by_bic_and_conditioning_follows_its_lines():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(-2.0, -1.0, 400), rng.uniform(1.0, 2.0, 400)])
    y = np.where(x < 0.0, 2.0 * x, 1.0 - x) + 0.02 * rng.normal(size=800)
    mixture = gmm.select(np.column_stack([x, y]), 5)
    assert len(mixture.priors) >= 2
    given = np.array([[-1.5], [1.5]])
    # the regularisation of 1e-4 on a variance of 1/12 shortens slopes by 0.1 %
    np.testing.assert_allclose(gmm.conditional_mean(mixture, given)[:, 0], [-3.0, -0.5], atol=0.03)


@pytest.mark.slow
def test_em_never_lowers_the_likelihood_of_more_components_than_needed():
    samples = np.random.default_rng(1).normal(size=(500, 3))
    assert len(gmm.select(samples, 6).priors) == 1  # one cloud: BIC wants one


@pytest.mark.slow  # what it follows from is asked in the next test
def test_a_thousand_random_starts_converge_and_the_lyapunov_function_decreases(documents):
    skill = seds.build(documents["seds"])
    rng = np.random.default_rng(5)
    states = rng.uniform(-5.0, 5.0, (1000, 6))  # five times as far as was demonstrated, in every coordinate
    energy = 0.5 * (states**2).sum(1)
    for _ in range(15000):  # steps of 5 ms, as in the loop; the slowest rate allowed is 0.2 per second
        states = skill.advanced(states, np.full(len(states), 0.005))
        now = 0.5 * (states**2).sum(1)
        assert np.all(now < energy)
        left = now > 1e-4  # 1 % of the demonstrations' spread; the rest go on
        states, energy = states[left], now[left]
        if not len(states):
            break
    assert not len(states)


def test_every_component_is_stable_and_an_unstable_one_is_refused(documents):
    dynamics = seds.dynamics_of(documents["seds"])
    symmetric = dynamics.matrices + np.swapaxes(dynamics.matrices, 1, 2)
    assert np.linalg.eigvalsh(symmetric).max() <= -2.0 * SLOWEST + 1e-9
    broken = copy.deepcopy(documents["seds"])
    broken["model"]["matrices"][0][0][0] = 0.5
    with pytest.raises(InputError, match="not stable"):
        seds.build(broken)


def test_the_fit_recovers_a_stable_linear_system_from_its_own_paths():
    from skillframe_baselines.seds_fit import fit

    rng = np.random.default_rng(3)
    turning = rng.normal(size=(6, 6))
    matrix = -np.diag([0.5, 0.6, 0.8, 1.0, 1.2, 1.5]) + 0.5 * (turning - turning.T)
    states = rng.normal(size=(400, 6))
    flow = Flow(fit(states, states @ matrix.T, 1))
    fresh = rng.normal(size=(100, 6))
    error = norm(flow(fresh) - fresh @ matrix.T).max() / norm(fresh @ matrix.T).max()
    assert error < 0.01  # the regularisation of the mixture that it starts from is 1e-4


def random_approaches(seed):
    """One to three approaches of different size, pace and length."""
    rng = np.random.default_rng(seed)
    return [
        approach(
            rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 1.0), duration=rng.uniform(1.5, 3.0), pace=rng.uniform(0.7, 1.5)
        )
        for _ in range(rng.integers(1, 4))
    ]


def samples(demonstrations):
    """States and velocities as the fit is given them, every third."""
    return (part[::3] for part in seds.samples_of(align.recorded(demonstrations, np.zeros(3)))[1:])


def squared_error(dynamics, states, velocities):
    return float(np.mean((Flow(dynamics)(states) - velocities) ** 2))


@pytest.mark.parametrize("seed", [None, 0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_several_components_never_follow_the_demonstrations_worse_than_one(seed):
    from skillframe_baselines.seds_fit import fit

    states, velocities = samples(both_sides() if seed is None else random_approaches(seed))
    several, one = (squared_error(fit(states, velocities, most), states, velocities) for most in (2, 1))
    assert several <= one


def test_where_several_descend_to_something_worse_the_one_component_is_kept(monkeypatch):
    from skillframe_baselines import seds_fit

    states, velocities = samples(both_sides())
    one = seds_fit.fit(states, velocities, 1)
    optimised = seds_fit._optimised

    def unlucky(states, velocities, start):
        found = optimised(states, velocities, start) if len(start.priors) == 1 else start
        return found if len(start.priors) == 1 else found._replace(matrices=1.1 * found.matrices)

    monkeypatch.setattr(seds_fit, "_optimised", unlucky)
    kept = seds_fit.fit(states, velocities, 4)
    assert len(kept.priors) == 1
    np.testing.assert_array_equal(kept.matrices, one.matrices)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_two_linear_systems_that_take_turns_are_followed_by_several_components_and_not_by_one(seed):
    from skillframe_baselines.seds_fit import fit

    rng = np.random.default_rng(seed)
    turning = rng.normal(size=(2, 6, 6))
    matrices = 0.7 * (turning - np.swapaxes(turning, 1, 2)) - np.stack(
        [np.diag(r) for r in rng.uniform(0.4, 2.0, (2, 6))]
    )
    means = np.stack([1.5 * np.eye(6)[0], -1.5 * np.eye(6)[0]])
    states = np.concatenate([rng.normal(size=(80, 6)) + mean for mean in means])
    velocities = Flow(Dynamics(np.full(2, 0.5), means, np.stack([np.eye(6)] * 2), matrices))(states)
    several, one = (squared_error(fit(states, velocities, most), states, velocities) for most in (2, 1))
    assert several < 0.01 * one  # 1e-5 of the velocities' square is left, and 0.3 by one
