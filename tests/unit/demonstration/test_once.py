"""Searches that are done once for arrays of one content."""

import numpy as np

from skillframe.demonstration.content_cache import KEPT, Once


def counted():
    calls = []

    def search(array, *, more=0):
        calls.append(array.copy())
        return [float(array.sum()) + more]

    return Once(search), calls


def test_equal_arrays_are_searched_once_and_others_anew():
    search, calls = counted()
    assert search(np.arange(6.0)) == [15.0] == search(np.arange(6.0)) and len(calls) == 1
    assert search(np.arange(6.0), more=1) == [16.0] and len(calls) == 2
    assert search(np.arange(6.0).reshape(2, 3)) == [15.0] and len(calls) == 3
    assert search(np.arange(12.0)[::2]) == [30.0] and len(calls) == 4


def test_an_array_changed_in_place_is_searched_anew_and_an_answer_changed_stays_what_it_was():
    search, calls = counted()
    array = np.arange(4.0)
    search(array).append(7.0)
    assert search(array) == [6.0] and len(calls) == 1
    array[0] = 1.0
    assert search(array) == [7.0] and len(calls) == 2


def test_few_answers_are_kept():
    search, calls = counted()
    for i in range(KEPT + 1):
        search(np.array([float(i)]))
    search(np.array([0.0]))
    assert len(calls) == KEPT + 2 and len(search.answers) == KEPT
