"""Commands that arrive late: whole, and so many ticks later."""

import numpy as np

from skillframe.signals import CommandDelay


def test_a_delayed_command_arrives_whole_ticks_later():
    line = CommandDelay(np.array([0, 3]), 1)
    arrived = np.array([line.step(np.full((2, 1), float(tick)))[:, 0] for tick in range(1, 8)])
    assert arrived[:, 0].tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert arrived[:, 1].tolist() == [0, 0, 0, 1, 2, 3, 4]
    line = CommandDelay(np.array([0, 3]), 1, held=True)
    arrived = np.array([line.step(np.full((2, 1), float(tick)))[:, 0] for tick in range(1, 8)])
    assert arrived.T.tolist() == [[1, 2, 3, 4, 5, 6, 7], [1, 1, 1, 1, 2, 3, 4]]
