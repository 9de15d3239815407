import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.campaign.sampling import Axis, draws, trial_rng, trial_rngs
from skillframe.campaign.spec import CampaignSpec

INDEPENDENT = {
    "start.tilt_y": Axis(kind="uniform", numbers=(-0.21, 0.21)),
    "start.offset_x": Axis(kind="normal", numbers=(0.001, 0.002)),
    "world.friction": Axis(kind="choice", numbers=(0.1, 0.2, 0.3)),
    "robot.mass_scale": Axis(kind="uniform", numbers=(0.9, 1.1)),
}
DESIGNS = {
    "start.tilt_x": Axis(kind="grid", numbers=(-1.0, 0.0, 1.0)),
    "start.tilt_z": Axis(kind="grid", numbers=(5.0, 6.0)),
    "fixture.offset_x": Axis(kind="sobol", numbers=(-2.0, 2.0)),
    "fixture.offset_y": Axis(kind="sobol", numbers=(0.0, 1.0)),
}


def spec(axes, seed=7, skills=("a.skill.json",)):
    return CampaignSpec(
        name="c", seed=seed, trials=1000, robot="r", world="w", skills=tuple(skills), vary=dict(axes)
    )  # fmt: skip


SUBSETS = st.sets(st.sampled_from(sorted(INDEPENDENT)), min_size=1)
TRIALS = st.lists(st.integers(0, 999), min_size=1, max_size=20, unique=True)


@given(names=SUBSETS, trials=TRIALS, order=st.randoms())
def test_a_draw_depends_on_its_own_name_and_trial_only(names, trials, order):
    everything = draws(spec({**INDEPENDENT, **DESIGNS}), trials)
    shuffled = sorted(names)
    order.shuffle(shuffled)
    some = draws(spec({n: INDEPENDENT[n] for n in shuffled}, skills=("a", "b", "c")), trials)
    assert list(some) == shuffled
    for name in names:
        np.testing.assert_array_equal(some[name], everything[name])


@given(trials=TRIALS, cut=st.integers(0, 20))
def test_draws_are_the_same_in_any_chunk_and_order(trials, cut):
    s = spec({**INDEPENDENT, **DESIGNS})
    whole = draws(s, trials)
    backwards = draws(s, trials[::-1])
    first, second = draws(s, trials[:cut]), draws(s, trials[cut:])
    for name, values in whole.items():
        np.testing.assert_array_equal(values, backwards[name][::-1])
        np.testing.assert_array_equal(values, np.concatenate([first[name], second[name]]))


@given(seed=st.integers(0, 2**63), trial=st.integers(0, 10**6))
def test_a_trials_generator_is_fresh_at_every_call_and_its_own(seed, trial):
    first, again, neighbour = trial_rng(seed, trial), trial_rngs(seed, [trial])[0], trial_rng(seed, trial + 1)
    drawn = first.standard_normal(8)
    np.testing.assert_array_equal(drawn, again.standard_normal(8))
    assert not np.any(drawn == neighbour.standard_normal(8))


def test_seeds_give_different_draws():
    names = ("start.tilt_y", "start.offset_x", "fixture.offset_x")
    axes = {name: {**INDEPENDENT, **DESIGNS}[name] for name in names}
    one, two = draws(spec(axes, seed=1), range(100)), draws(spec(axes, seed=2), range(100))
    for name in names:
        assert not np.any(one[name] == two[name])


def test_every_prefix_of_whole_sweeps_covers_the_grid_evenly():
    drawn = draws(spec(DESIGNS), range(18))
    cells = list(zip(drawn["start.tilt_x"], drawn["start.tilt_z"], strict=True))
    assert len(set(cells[:6])) == 6
    assert cells[:6] == cells[6:12] == cells[12:]


def test_axes_of_a_grid_that_are_equally_long_meet_in_every_combination():
    """Where lengths have no common divisor, axes that run side by side would do so, too."""
    axes = {f"start.tilt_{axis}": Axis(kind="grid", numbers=(0.0, 0.1, 0.2)) for axis in "xy"}
    drawn = draws(spec(axes), range(9))
    assert len(set(zip(*drawn.values(), strict=True))) == 9


@pytest.mark.parametrize("count", [16, 64, 256])
def test_each_sobol_axis_puts_one_point_into_each_of_2_to_the_m_equal_slices(count):
    drawn = draws(spec({name: axis for name, axis in DESIGNS.items() if axis.kind == "sobol"}), range(count))
    for name in ("fixture.offset_x", "fixture.offset_y"):
        low, high = DESIGNS[name].numbers
        slices = np.floor((drawn[name] - low) / (high - low) * count)
        np.testing.assert_array_equal(np.sort(slices), np.arange(count))


def test_independent_draws_follow_their_distributions():
    drawn = draws(spec(INDEPENDENT), range(4000))
    # means of 4000 draws: bounds of five standard errors
    assert abs(drawn["start.tilt_y"].mean()) < 5 * 0.42 / np.sqrt(12 * 4000)
    assert abs(drawn["start.offset_x"].mean() - 0.001) < 5 * 0.002 / np.sqrt(4000)
    assert abs(drawn["start.offset_x"].std() - 0.002) < 5 * 0.002 / np.sqrt(8000)
    counts = [np.sum(drawn["world.friction"] == value) for value in (0.1, 0.2, 0.3)]
    assert sum(counts) == 4000
    assert all(abs(n - 4000 / 3) < 5 * np.sqrt(4000 * 2 / 9) for n in counts)
    assert np.abs(drawn["start.tilt_y"]).max() <= 0.21
    correlation = np.corrcoef([drawn[n] for n in ("start.tilt_y", "start.offset_x", "robot.mass_scale")])
    assert np.abs(correlation - np.eye(3)).max() < 5 / np.sqrt(4000)


def test_listed_values_go_to_their_trials():
    axis = Axis(kind="values", numbers=tuple(float(i * i) for i in range(1000)))
    np.testing.assert_array_equal(draws(spec({"start.offset_z": axis}), [3, 1])["start.offset_z"], [9.0, 1.0])


def test_text_and_mixed_choices_keep_their_types():
    axis = Axis(kind="choice", numbers=("round", "square"))
    assert set(draws(spec({"world.profile": axis}), range(50))["world.profile"]) == {"round", "square"}
    mixed = draws(spec({"world.profile": Axis(kind="choice", numbers=("round", 2))}), range(50))["world.profile"]
    assert set(mixed) == {"round", 2}


ONE, TWO = ["world.x"], ["world.x", "world.y"]


@pytest.mark.parametrize(
    ("other", "lower", "sobol"),
    [
        (Axis(kind="grid", numbers=(0.0, 1.0, 2.0, 3.0)), (0.0, 3.0), ONE),
        (Axis(kind="values", numbers=(0.0, 1.0, 1.0, 0.0) * 32), (0.0,), ONE),
        (Axis(kind="grid", numbers=(0.0, 1.0)), (0.0,), TWO),
    ],
    ids=["grid of four", "values in turns", "grid of two and a second sobol axis"],
)
def test_a_sobol_axis_is_not_bound_to_the_cells_of_a_grid(other, lower, sobol):
    """Success where a cell of half of them meets the lower half of the box, or neither: 1/2, and not 0 or 1."""
    rates = []
    for seed in range(20):
        vary = {"world.a": other, **{name: Axis(kind="sobol", numbers=(0.0, 1.0)) for name in sobol}}
        drawn = draws(
            CampaignSpec(name="s", seed=seed, trials=128, robot="r", world="w", skills=("a.json",), vary=vary),
            range(128),
        )
        rates.append(np.mean(np.isin(drawn["world.a"], lower) == (drawn[sobol[-1]] < 0.5)))
    # standard deviation of a share of 128 fair coins is 0.044; five of them
    assert np.abs(np.array(rates) - 0.5).max() < 0.22


def test_shuffled_sobol_points_are_the_same_points_and_do_not_depend_on_the_chunks():
    axis, cells = Axis(kind="sobol", numbers=(0.0, 1.0)), Axis(kind="grid", numbers=(0.0, 1.0))
    alone, beside = (
        CampaignSpec(name="s", seed=3, trials=64, robot="r", world="w", skills=("a.json",), vary=vary)
        for vary in ({"world.b": axis}, {"world.a": cells, "world.b": axis})
    )
    whole = draws(beside, range(64))["world.b"]
    assert sorted(whole) == sorted(draws(alone, range(64))["world.b"])
    assert [draws(beside, [t])["world.b"][0] for t in (63, 0, 17)] == [whole[63], whole[0], whole[17]]
