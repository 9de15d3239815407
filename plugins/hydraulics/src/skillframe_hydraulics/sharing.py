r"""Sharing of a pump's flow by slowing all motion down together.

The commanded path of the tool is played at the pace w <= 1, so that the tool stays on it where the pump is too small
for its speed. With the required motion s_r' of the pistons at the present pace,

    w -> min(1, 0.92 Q_max w / sum A |s_r'|),     X = X_d(tau),  X' = w X_d'(tau),  tau' = w,

falling with a time constant of 20 ms and rising with one of 250 ms. Where the skill's pose stands still the path grows
no longer, and what is left of it is played. Stiffness and push of a skill act at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float, Pose
from skillframe.skill import Command
from skillframe_hydraulics.declared import DeclaredSupply
from skillframe_hydraulics.law.hydraulic import Terms
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.supply import Supplies


@dataclass(frozen=True, slots=True, kw_only=True)
class SharingSettings:
    """Settings of the pace.

    Attributes:
        share: of the pump's largest flow that the commanded motion may take; the rest corrects errors.
        slower, faster: time constants of the pace [s]; slower than the pump's own fall would leave the path.
        latest: longest delay of the path [s]; beyond it the tool leaves the path.
        least: pace from which on a longer delay is not helped by a slower one.
    """

    share: float = 0.92
    slower: float = 0.02
    faster: float = 0.25
    latest: float = 8.0
    least: float = 0.05


class FlowSharing:
    """The pace of N trials whose supplies say `sharing = "law"`.

    Attributes:
        pace: w (N,); slowed: (N,) time at a pace below 0.98 [s]; least: smallest pace (N,).
    """

    def __init__(
        self, declared: Mapping[str, DeclaredSupply], supplies: Supplies, law: CompiledLaw, joints: int, dt: float,
        settings: SharingSettings | None = None,
    ) -> None:  # fmt: skip
        self.settings, self._supplies, self._law, self._dt = settings or SharingSettings(), supplies, law, dt
        self._shares = np.array([one.sharing == "law" for one in declared.values()])
        self._free: Float = np.eye(joints)
        count = len(supplies.pressure)
        self.pace, self.least, self.slowed = np.ones(count), np.ones(count), np.zeros(count)
        self._rows = np.arange(count)
        self._length = round(self.settings.latest / dt)
        self._path: Float = np.zeros((self._length if self._shares.any() else 0, count, 6))
        """Positions and velocities that the skill commanded, a ring; `_last` is the latest, `_at` the one played."""
        self._last, self._at = np.full(count, -1), np.full(count, -1.0)

    def shared(self, command: Command, terms: Terms) -> Command:
        """The command at the present pace."""
        if not self._shares.any():
            return command
        self._set_pace(terms)
        given = command.pose.position
        moved = (self._path[self._last % self._length, self._rows, :3] != given).any(axis=1) | (self._last < 0)
        self._last = self._last + moved
        self._path[self._last % self._length, self._rows] = np.concatenate([given, command.twist[:, :3]], axis=1)
        self._at = np.clip(self._at + self.pace, self._last - (self._length - 2), self._last)
        before = np.floor(self._at).astype(np.int64)
        part = (self._at - before)[:, None]
        here, there = (self._path[(before + i) % self._length, self._rows] for i in (0, 1))
        position = (1.0 - part) * here[:, :3] + part * there[:, :3]
        twist = command.twist.copy()
        twist[:, :3] = self.pace[:, None] * here[:, 3:]
        return command._replace(pose=Pose(position, command.pose.rotation), twist=twist)

    def _set_pace(self, terms: Terms) -> None:
        s, supplies = self.settings, self._supplies
        most = s.share * supplies.lines.most(supplies.pressure)
        needed = np.maximum(self._flows(terms) / np.maximum(self.pace, s.least)[:, None], 1e-12)
        wanted = np.min(np.where(self._shares, most / needed, 1.0), axis=1).clip(0.0, 1.0)
        constant = np.where(wanted < self.pace, s.slower, s.faster)
        self.pace = self.pace + (wanted - self.pace) * (self._dt / constant)
        self.least = np.minimum(self.least, self.pace)
        self.slowed += self._dt * (self.pace < 0.98)

    def _flows(self, terms: Terms) -> Float:
        """Flows (N, L) that the required motion takes from the lines, without the force's attenuation."""
        (measured, reference), c = self._law.given, self._law.cylinders
        pull = (reference.stiffness @ (reference.position - terms.tip)[..., None])[..., 0]
        pull += measured.force + reference.push
        rate = reference.velocity + np.linalg.solve(reference.damping, pull[..., None])[..., 0]
        free = self._free.shape[0] - rate.shape[1]
        held = measured.z[:, -free:] if free else reference.joint
        joint = reference.joint_rate + self._law.gains.joint * (reference.joint - held)
        rows = np.broadcast_to(self._free[-free:] if free else self._free[:0], (len(rate), free, len(self._free)))
        jacobian = np.concatenate([terms.jacobian, rows], axis=1)
        turns = np.linalg.solve(jacobian, np.concatenate([rate, joint], axis=1)[..., None])
        speed = (terms.arms @ turns)[..., 0]
        flow = np.abs(speed) * np.where(speed > 0.0, c.area_a, c.area_b)
        result: Float = (flow[:, None] * self._supplies.lines.feeds).sum(axis=-1)
        return result

    def said(self, trial: int) -> list[str]:
        """A sentence if the trial was slowed down."""
        if self.slowed[trial] == 0.0:
            return []
        late = max(0.0, float(self._last[trial] - self._at[trial])) * self._dt
        text = f"the motion was slowed down for {self.slowed[trial]:.2f} s to share the pump's flow, to"
        return [f"{text} {self.least[trial]:.2f} of its speed at least; it ends {late:.2f} s behind its command"]
