"""A function of one trial, run where its arrays are: rows with gaps between them, and memories."""

import casadi as ca
import numpy as np
import pytest
from skillframe_hydraulics.law.generated import Batch

EVERYONE = np.arange(4)


def summing():
    """(x (2,), scale, sum (2,)) -> (scale x, sum + scale x)."""
    x, scale, before = ca.SX.sym("x", 2), ca.SX.sym("scale"), ca.SX.sym("before", 2)
    return ca.Function("summing", [x, scale, before], [scale * x, before + scale * x])


@pytest.mark.parametrize("use_compiler", [True, False])
def test_arrays_are_read_and_written_where_they_are_and_memories_go_on(use_compiler):
    wide, written = np.arange(20.0).reshape(4, 5), np.full((4, 7), -1.0)
    scale, memory, after = np.array([3.0]), np.zeros((4, 2)), np.zeros((4, 2))
    arrays = [wide[:, 1:3], scale, memory], [written[:, 4:6], after]
    batch = Batch(summing(), *arrays, (1,), carried={1: 2}, use_compiler=use_compiler)
    batch.run(EVERYONE)
    scale[0] = 1.0
    wide[:, 2] = 100.0
    batch.run(np.array([1, 3]))
    expected = 3.0 * np.arange(20.0).reshape(4, 5)[:, 1:3]
    expected[[1, 3]] += np.stack([wide[[1, 3], 1], [100.0, 100.0]], axis=1)
    np.testing.assert_array_equal(memory, expected)
    np.testing.assert_array_equal(written[1, 4:6], [wide[1, 1], 100.0])
    np.testing.assert_array_equal(written[0, 4:6], 3.0 * np.array([1.0, 2.0]))
    assert np.all(np.delete(written, [4, 5], axis=1) == -1.0)


@pytest.mark.parametrize("use_compiler", [True, False])
def test_one_number_a_trial_is_a_row_too(use_compiler):
    x = ca.SX.sym("x")
    given, found = np.arange(4.0), np.zeros(4)
    Batch(ca.Function("twice", [x], [2.0 * x]), [given], [found], use_compiler=use_compiler).run(EVERYONE)
    np.testing.assert_array_equal(found, 2.0 * given)


def test_rows_that_are_not_contiguous_are_refused():
    with pytest.raises(ValueError, match="array 0 of summing"):
        Batch(summing(), [np.zeros((2, 4)).T, np.ones(1), np.zeros((4, 2))], [np.zeros((4, 2)), np.zeros((4, 2))], (1,))
