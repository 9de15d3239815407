"""Drives with one defect each: every one is named by what it does, and a sound one passes."""

import numpy as np
import pytest
from skillframe_testkit.checks import check_drive

from skillframe.execution.drives.torque import OneArm, TorqueDrive
from skillframe.extend import DriveType, Lazy


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (Lazy("skillframe.no_such_module:Drive"), "raised ModuleNotFoundError"),
        (Lazy("skillframe.skill:no_such_name"), "raised AttributeError"),
        (Lazy("skillframe.skill:__name__"), "which cannot be called"),
        (None, "which cannot be called"),
    ],
)
def test_a_drive_that_nothing_makes_is_named(make, said):
    assert said in "\n".join(check_drive(DriveType(name="mine", summary="a drive", make=make)))


def planted_drive(change):
    """A drive of ideal torques with one defect, made as plug-ins make theirs."""

    def make(setup, draws, rngs):
        made = TorqueDrive(setup, OneArm(setup, draws, rngs))
        change(made)
        return made

    return DriveType(name="mine", summary="a drive", make=make)


def shared(drive):
    """All trials get the mean of their torques."""
    advance = drive.advance

    def mixed(active):
        drive._torque = np.broadcast_to(drive._torque.mean(axis=0), drive._torque.shape)
        return advance(active)

    drive.advance = mixed


def weak(drive):
    """Half the torque: the arm sinks."""
    advance = drive.advance

    def half(active):
        drive._torque = 0.5 * drive._torque
        return advance(active)

    drive.advance = half


def breaks(drive):
    def advance(active):
        raise ValueError("no bus")

    drive.advance = advance


@pytest.mark.slow
def test_a_drive_that_holds_a_tool_still_passes():
    assert check_drive(planted_drive(lambda drive: None)) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [(weak, "stand still moves by"), (shared, "other numbers than alone"), (breaks, "raised ValueError: no bus")],
    ids=lambda value: getattr(value, "__name__", ""),
)
@pytest.mark.slow
def test_a_drive_with_a_defect_is_named_by_what_it_does(change, said):
    assert said in "\n".join(check_drive(planted_drive(change)))


def test_what_is_no_drive_is_named_with_what_it_lacks():
    (problem,) = check_drive(DriveType(name="mine", summary="a drive", make=lambda setup, draws, rngs: object()))
    assert "a object, which is no drive: it lacks act, actuators, advance" in problem
