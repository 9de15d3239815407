"""A seating that is played tick by tick, its push and its search by scripts."""

from dataclasses import replace
from math import sqrt

import numpy as np
from skillframe_search import seat, seat_document, seat_learner
from skillframe_search.handling import HANDLING, Handling
from skillframe_search.seat_document import Seat

from skillframe.extend.registry import registry
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons

DOWN = np.array([0.0, 0.0, -1.0])


class Script(Skill):
    """Commands a feed-forward of its own, and ends where it is told to."""

    def __init__(self):
        self.begun, self.ends, self.lead, self.speed = [], {}, np.zeros(3), 0.0
        self.impedance = Impedance(np.eye(6))

    def start(self, observation, rngs):
        self.n = len(rngs)
        self.begun.append((np.arange(self.n), observation.pose))

    def restart(self, rows, observation, rngs):
        self.begun.append((rows, Pose(observation.pose.position[rows], observation.pose.rotation[rows])))

    def step(self, observation):
        status, reason = np.zeros(self.n, dtype=np.int64), no_reasons(self.n)
        for row, end in self.ends.items():
            status[row], reason[row] = end, "told to"
        self.ends = {}
        pose, twist = observation.pose._replace(position=observation.pose.position + self.lead), np.zeros((self.n, 6))
        twist[:, :3] = self.speed * DOWN
        return Command(pose, twist, self.impedance, np.ones((self.n, 6)), status, reason)


def known(monkeypatch, **kinds):
    class Known:
        def skill(self, name):
            return kinds.get(name) or registry().skill(name)

        def names(self, kind):
            return sorted({*registry().names(kind), *kinds})

    for module in (seat, seat_document, seat_learner):
        monkeypatch.setattr(module, "registry", Known)


SEAT = Seat(way=(0.0, 0.0, -1.0), point=(0.0, 0.0, 0.0), end=(0.4, 0.0, 0.2), orientation=(0.0, 0.0, 0.0),
            start=(0.4, 0.0, 0.23), contact_m=0.012, approach=False, settle_s=0.0)  # fmt: skip
MOST_TILT = sqrt(2.0) * SEAT.tilt_rad
"""A fixture that is off by the stated tilt about both axes across the way is off by so much [rad]."""


class Played:
    """A seating of three trials, tick by tick at 100 Hz."""

    def __init__(self, **changes):
        self.push, self.search = Script(), Script()
        how = {name: changes.pop(name) for name in [*changes] if name in Handling.__dataclass_fields__}
        placed = replace(SEAT, **changes)
        self.skill = seat.Seating(placed, np.zeros(3), lambda: self.push, lambda: self.search, replace(HANDLING, **how))
        self.time, self.deep, self.aside, self.turn, self.speed = (
            0.0,
            np.full(3, -0.012),
            np.zeros(3),
            np.zeros((3, 3)),
            0.0,
        )
        self.skill.start(self.seen(), [np.random.default_rng(i) for i in range(3)])

    def seen(self):
        position = np.array(SEAT.end) + self.deep[:, None] * DOWN + self.aside[:, None] * np.array([1.0, 0.0, 0.0])
        twist = np.zeros((3, 6))
        twist[:, :3] = self.speed * DOWN
        return Observation(
            np.full(3, self.time), 0.01, Pose(position, rotation_matrix(self.turn)), twist, np.zeros((3, 6))
        )

    def go(self, seconds=0.01, **ends):
        for _ in range(round(seconds / 0.01)):
            command = self.skill.step(self.seen())
            self.time += 0.01
        return command


def searching(**changes):
    played = Played(**changes)
    played.go()
    played.push.ends = {0: Status.SUCCESS}
    played.go(0.02)
    assert played.skill.current.tolist() == [seat.SEARCHING, seat.PUSHING, seat.PUSHING]
    return played
