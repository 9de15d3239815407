"""A small insertion with search as its exception, for one trial at a time: insert, if stalled search, if found insert.

Stalled means both: over half a second the tool went less than 0.5 mm along the push, and was answered by more than 8 N
in the mean. The force alone would fire on an impact, the progress alone on a pause in free air.
"""

from collections import deque
from functools import cache

import numpy as np

from skillframe.registry import registry
from skillframe.skill import Skill, Status
from skillframe.skillfile import new_document

WINDOW_S, PROGRESS_M, ANSWER_N, TOUCH_N = 0.5, 5e-4, 8.0, 2.0
DOWN = np.array([0.0, 0.0, -1.0])
TIP = [0.0, 0.0, 0.2]


@cache
def insertion():
    """An LMC document: push down at 20 mm/s, soft sideways, at the tip."""

    def part(direction, speed, stiffness):
        return {
            "desired_direction": direction, "speed": speed, "compliant_axes": [], "fully_compliant": False,
            "stiffness": np.diag(stiffness).tolist(), "damping": np.eye(3).tolist(), "evidence": {},
        }  # fmt: skip

    body = {
        "frame": {"work_at": TIP, "learned_at": TIP, "center_of_compliance": TIP, "axes": "base"},
        "phases": [{
            "name": "insert", "translation": part([0.0, 0.0, -1.0], 0.02, [300.0, 300.0, 600.0]),
            "rotation": part(None, 0.0, [60.0] * 3), "pitch": None, "stop": {"stall_s": 60.0, "force_limit_n": 75.0},
        }],
    }  # fmt: skip
    return new_document(registry().skill("lmc"), body)


class Stall:
    """Watches one trial for a push that goes nowhere."""

    def __init__(self, observation):
        self.began = float(observation.time[0])
        self.seen = deque()

    def look(self, observation):
        now, answer = float(observation.time[0]), -float(observation.wrench[0, :3] @ DOWN)
        self.seen.append((now, float(observation.pose.position[0] @ DOWN), answer))
        while self.seen[0][0] < now - WINDOW_S:
            self.seen.popleft()
        if now - self.began < WINDOW_S:
            return False
        progress = self.seen[-1][1] - self.seen[0][1]
        return progress < PROGRESS_M and np.mean([s[2] for s in self.seen]) > ANSWER_N


class Recovering(Skill):
    """Insert; where that stalls, search (if there is a search document) and insert again. One trial.

    Attributes:
        touched, alarms: when the surface was first felt, and when stalls were called [s].
        found: how the searches ended.
    """

    def __init__(self, search_document, log):
        self.search_document, self.log = search_document, log

    def start(self, observation, rngs):
        self.rngs, self.searching = rngs, False
        self.record = {"touched": None, "alarms": [], "found": []}
        self.log.append(self.record)
        self._insert(observation)

    def _insert(self, observation):
        self.skill, self.stall, self.searching = registry().skill("lmc").build(insertion()), Stall(observation), False
        self.skill.start(observation, self.rngs)

    def step(self, observation):
        if self.record["touched"] is None and -observation.wrench[0, :3] @ DOWN > TOUCH_N:
            self.record["touched"] = float(observation.time[0])
        command = self.skill.step(observation)
        if self.searching:
            if command.status[0] == Status.SUCCESS:
                self.record["found"].append(float(observation.time[0]))
                self._insert(observation)
                return self.skill.step(observation)
            return command
        if not self.stall.look(observation):
            return command
        self.record["alarms"].append(float(observation.time[0]))
        if self.search_document is None:
            reason = np.array(["stalled"], dtype=object)
            return command._replace(status=np.array([Status.FAILURE]), reason=reason)
        self.skill, self.searching = registry().skill("search").build(self.search_document), True
        self.skill.start(observation, self.rngs)
        return self.skill.step(observation)
