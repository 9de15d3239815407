"""The outcome of a run in words."""

from skillframe.execution.result import joint_shares, peak_forces
from skillframe.execution.trace import SHARE_JOINTS, SHARES


def test_the_three_forces_have_a_name_each_in_one_order_and_the_unknown_ones_none():
    values = {"peak_force_filtered_n": 7.0, "peak_force_n": 10.0, "peak_force_10ms_n": 8.0}
    whole = ["peak contact force in simulation 10 N", "over 10 ms 8 N", "by the estimate 7 N"]
    assert peak_forces(values, "{:g}".format) == whole
    assert peak_forces({**values, "peak_force_10ms_n": float("nan")}, "{:g}".format) == [whole[0], whole[2]]
    assert peak_forces({}, "{:g}".format) == []


def test_a_run_says_its_shares_with_their_joints_and_an_older_one_without():
    known = dict(zip((*SHARES, *SHARE_JOINTS), (0.32, None, 0.61, "joint2", "", "joint4"), strict=True))
    assert joint_shares(known) == [
        "torque at most 32% of its limit (joint2)",
        "range at most 61% from its middle to an end (joint4)",
    ]
    assert joint_shares({"peak_speed_share": 0.08}) == ["speed at most 8% of its limit"]
    assert joint_shares({}) == []
