"""Hydraulic machines: the loop for them, its calibration in the air, their FMUs and what their traces hold."""

from skillframe.machine.loop import MachineLoop, simulate_machine

__all__ = ["MachineLoop", "simulate_machine"]
