"""How an insertion with two arms ended, told from how far each tool turned."""

import numpy as np
from skillframe_papers.rows.insertion import classify

from skillframe.execution.result import ArmsResult
from skillframe.skill import no_reasons


def result(turned_deg, final_deg, success):
    n = len(success)
    turned = np.zeros((n, 2, 3))
    turned[..., 1] = np.radians(turned_deg)
    zero = np.zeros(n)
    return ArmsResult(
        success=np.array(success), failure=no_reasons(n), status=np.zeros(n, np.int64), reason=no_reasons(n),
        duration_s=zero, peak_force_n=zero, final_error_m=zero, final_error_rad=np.radians(final_deg), energy_j=zero,
        arms=("left", "right"), joint_path_rad=np.zeros((n, 2, 7)), turned_rad=turned,
    )  # fmt: skip


def test_failures_are_told_apart_by_how_far_each_tool_turned():
    runs = result(
        [[-8, 0], [0.5, -0.5], [20, 18], [15, -15], [-20, -18]], [0.5, 7.0, 8.7, 38.0, 8.0], [True] + 4 * [False]
    )
    found = classify(runs, np.radians([8.0, 8.0, 10.0, 8.0, -10.0]), np.array([0.0, 1.0, 0.0]))
    assert found == ["success", "jam", "common rotation", "turned away", "common rotation"]
