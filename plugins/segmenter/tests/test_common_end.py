"""A run ends where most demonstrations ended, whatever one of them did afterwards."""

import numpy as np
import pytest
from skillframe_segmenter.document import to_the_common_end
from skillframe_segmenter.segmentation import successors


def counted(labels, phases):
    return to_the_common_end(successors([np.array(each) for each in labels], phases), labels)


@pytest.mark.parametrize(
    ("labels", "phases", "same_as"),
    [
        ([[0, 1], [0, 1, 0], [0, 1]], 2, [[0, 3, 1], [0, 0, 3]]),  # it lingered, which felt like coming
        ([[0, 1, 2], [0, 1], [0, 1]], 3, [[0, 3, 0, 0], [0, 0, 0, 3], [0, 0, 0, 1]]),  # it was on its way out
        ([[0, 1, 0, 1, 2], [0, 1], [0, 1]], 3, [[0, 4, 0, 0], [1, 0, 0, 3], [0, 0, 0, 1]]),  # only the last leaving
    ],
)
def test_what_one_demonstration_did_after_the_others_had_ended_is_not_gone_on_to(labels, phases, same_as):
    np.testing.assert_array_equal(counted(labels, phases), same_as)


@pytest.mark.parametrize(
    ("why", "labels", "phases"),
    [
        ("a peg is turned upright by the way, and ends where the others end", [[0, 1, 0], [0], [0]], 2),
        ("one came to a wall before the corner", [[0, 1, 2], [0, 2], [0, 2]], 3),
        ("two demonstrations have no majority", [[0, 1], [0, 1, 2]], 3),
        ("half is not most", [[0, 1], [0, 1], [0, 1, 2], [0, 1, 2]], 3),
        ("another task altogether", [[0, 1], [0, 1], [2, 3]], 4),
        ("one demonstration is its own end", [[0, 1, 0]], 2),
    ],
)
def test_ways_before_the_common_end_are_all_kept(why, labels, phases):
    np.testing.assert_array_equal(counted(labels, phases), successors([np.array(x) for x in labels], phases), why)


def test_nothing_changes_where_no_demonstrations_are_told():
    counts = np.array([[0.0, 2.0, 1.0], [1.0, 0.0, 2.0]])
    np.testing.assert_array_equal(to_the_common_end(counts, []), counts)
    np.testing.assert_array_equal(to_the_common_end(counts, [[], []]), counts)
