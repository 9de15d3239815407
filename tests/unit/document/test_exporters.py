"""What the core does with an exporter, whoever wrote it."""

import dataclasses

import numpy as np
import pytest

from skillframe.document.export import exported
from skillframe.errors import InputError
from skillframe.extend import MovingImpedance
from skillframe.extend.builtin import skillframe_exporters
from skillframe.extend.registry import BadPlugin

PHASE = MovingImpedance(
    axes="base", center=np.zeros(3), twist=np.zeros(6), stiffness=np.eye(6), damping=np.eye(6), lead_force=20.0,
    lead_torque=2.0, stop={"time_limit_s": 5.0},
)  # fmt: skip
CRISP = next(each for each in skillframe_exporters() if each.name == "crisp")


def with_writer(write):
    return dataclasses.replace(CRISP, name="mine", write=write)


def test_an_exporter_is_given_everything_that_stands_in_the_file_s_comments():
    lines = []
    assert exported(with_writer(lambda phase, given: lines.extend(given) or "text"), PHASE, ["push"]) == "text"
    assert lines[:2] == [CRISP.summary, "push"]
    assert lines[-len(CRISP.notes) - 1 :] == [f"checked against {CRISP.checked}", *CRISP.notes]
    assert "the phase ends with: time_limit_s 5" in lines


def test_a_refusal_of_an_exporter_is_its_own_sentence():
    def refuse(phase, lines):
        raise InputError("skill", "is too stiff", "learn it softer")

    with pytest.raises(InputError, match="skill: is too stiff; learn it softer"):
        exported(with_writer(refuse), PHASE, [])


def test_whatever_else_an_exporter_raises_is_a_sentence_that_names_it():
    with pytest.raises(BadPlugin, match=r"exporter mine: raised ZeroDivisionError: .*; report this to its author"):
        exported(with_writer(lambda phase, lines: 1 / 0), PHASE, [])


@pytest.mark.parametrize("gave", [None, "", b"bytes", {"a": 1}])
def test_what_is_no_text_is_never_written(gave):
    with pytest.raises(BadPlugin, match="not the text of a file"):
        exported(with_writer(lambda phase, lines: gave), PHASE, [])
