"""What the learner refuses, in words."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc.learner import learn

from skillframe.errors import InputError, UnknownName
from skillframe.extend import LearnOptions


def test_demonstrations_of_different_tools_are_refused() -> None:
    a, b = syn.valley(45, 0.2)
    a, b = replace(a, meta={"frames": {"tip": [0, 0, 0.1]}}), replace(b, meta={"frames": {"tip": [0, 0, 0.2]}})
    with pytest.raises(InputError, match="learn from demonstrations of one tool"):
        learn([a, b], LearnOptions())


def test_bad_requests_are_refused_in_words() -> None:
    demos = syn.valley(45, 0.2)
    with pytest.raises(InputError, match="no demonstration"):
        learn([], LearnOptions())
    with pytest.raises(InputError, match="unknown key 'stp_m'"):
        learn(demos, LearnOptions(settings={"stp_m": 0.001}))
    with pytest.raises(InputError, match="not a positive number"):
        learn(demos, LearnOptions(settings={"step_m": -1.0}))
    with pytest.raises(InputError, match="a share of the stiffness"):
        learn(demos, LearnOptions(settings={"side_stiffness": 1.5}))
    with pytest.raises(UnknownName, match="unknown point 'nose'"):
        learn(demos, LearnOptions(at="nose"))
    with pytest.raises(InputError, match="neither base nor phase_start"):
        learn(demos, LearnOptions(axes="bse"))
    wrench = demos[0].wrench.copy()
    wrench[5, 2] = np.nan
    with pytest.raises(InputError, match="not finite"):
        learn([replace(demos[0], wrench=wrench)], LearnOptions())
    with pytest.raises(InputError, match="record more"):
        learn([demos[0].between(0.0, 0.03)], LearnOptions())
