import numpy as np
import pytest
from skillframe_baselines.align import aligned, recorded, warp

from plugins.baselines.tests.demonstrations import GOAL, approach, both_sides
from skillframe.errors import InputError

TOOL_POINT = np.zeros(3)


def test_a_series_is_matched_with_itself_sample_by_sample():
    series = np.random.default_rng(0).normal(size=(300, 3)).cumsum(0)
    np.testing.assert_allclose(warp(series, series), np.arange(300), atol=1e-9)


@pytest.mark.parametrize("pace", [0.7, 1.0, 1.4])
def test_the_same_path_at_another_pace_is_matched_place_by_place(pace):
    one, other = approach(1.0), approach(1.0, duration=2.7, pace=pace, seed=3)
    common = aligned(recorded([one, other], TOOL_POINT))
    apart = np.abs(common.state[0, :, :3] - common.state[1, :, :3]).max()
    # unaligned, the paces 0.7 and 1.4 are 14 mm apart; matching at 25 Hz and 48 mm/s leaves 2 mm
    assert apart < 2.5e-3
    assert common.time[-1] == pytest.approx(2.35)


@pytest.mark.parametrize("seed", range(3))
def test_warping_runs_from_the_first_to_the_last_sample_and_never_back(seed):
    rng = np.random.default_rng(seed)
    index = warp(rng.normal(size=(250, 3)).cumsum(0), rng.normal(size=(180, 3)).cumsum(0))
    assert index[0] == 0.0 and index[-1] == 179.0
    assert np.all(np.diff(index) >= 0.0)


def test_demonstrations_from_either_side_are_matched_by_how_far_they_have_come():
    common = aligned(recorded(both_sides(), TOOL_POINT))
    np.testing.assert_allclose(common.state[0, :, 0], -common.state[1, :, 0], atol=3e-3)  # as above
    np.testing.assert_allclose(common.goal.position, GOAL, atol=1e-9)


def test_the_goal_is_the_mean_of_the_ends():
    found = recorded([approach(1.0, end=(0.002, 0.0, 0.0)), approach(-1.0, end=(0.0, 0.004, 0.0))], TOOL_POINT)
    np.testing.assert_allclose(found.goal.position, GOAL + np.array([0.001, 0.002, 0.0]), atol=1e-9)


def test_demonstrations_that_end_in_other_attitudes_are_refused():
    one = approach(1.0)
    turned = type(one)(
        time=one.time, position=one.position, wrench=one.wrench,
        quaternion=np.roll(one.quaternion, 2, axis=1),
    )  # fmt: skip
    with pytest.raises(InputError, match="more than 90 degrees apart"):
        recorded([one, turned], TOOL_POINT)
