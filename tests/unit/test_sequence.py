"""Skills of skills that start again in some trials, and skills that run as if base stood elsewhere."""

import numpy as np
from skillframe_testkit.suites import random_observations

from skillframe.frames import Pose, rotate, rotate_spatial, rotation_matrix
from skillframe.sequence import Fallback, Moved, Part, Sequence, seen_from
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons, rows_of

RNG = np.random.default_rng(3)
OBSERVATIONS = random_observations(RNG, 4, 60, 0.05)


class Walk(Skill):
    """Pushes by its generator from where it began, and ends a second after."""

    def __init__(self, end=Status.SUCCESS):
        self.end = end

    def start(self, observation, rngs):
        self.began, self.home = observation.time.copy(), observation.pose.position.copy()
        self.push = np.stack([rng.normal(size=6) for rng in rngs])

    def restart(self, rows, observation, rngs):
        fresh = Walk()
        fresh.start(rows_of(observation, rows), rngs)
        for name in ("began", "home", "push"):
            getattr(self, name)[rows] = getattr(fresh, name)

    def step(self, observation):
        status = np.where(observation.time - self.began >= 1.0, int(self.end), int(Status.RUNNING))
        impedance = Impedance(np.diag([100.0, 200.0, 300.0, 1.0, 2.0, 3.0]))
        pose = Pose(self.home, observation.pose.rotation)
        return Command(
            pose, observation.twist, impedance, self.push - observation.wrench, status, no_reasons(len(status))
        )


def made():
    retry = Sequence([Part("search", Walk), Part("retry", Walk)])
    return Fallback([Part("insert", lambda: Walk(Status.FAILURE)), Part("recover", lambda: retry)])


def same(a, b, rows):
    for x, y in zip(
        (*a.pose, a.twist, a.feedforward, a.status), (*b.pose, b.twist, b.feedforward, b.status), strict=True
    ):
        np.testing.assert_array_equal(x[rows], y)


def test_a_composition_that_starts_again_in_some_trials_does_what_one_that_starts_there_does():
    """Trials 1 and 3 start again in the second part's second part, and the others go on as if nothing had been."""
    rows, begins = np.array([1, 3]), 30
    whole, other, alone = made(), made(), made()
    for each in (whole, other):
        each.start(OBSERVATIONS[0], [np.random.default_rng(i) for i in range(4)])
    for i, seen in enumerate(OBSERVATIONS):
        if i == begins:
            fresh = [np.random.default_rng(10 + k) for k in rows]
            whole.restart(rows, seen, fresh)
            alone.start(rows_of(seen, rows), [np.random.default_rng(10 + k) for k in rows])
        command, kept = whole.step(seen), other.step(seen)
        same(command, rows_of_command(kept, [0, 2]), [0, 2])
        if i >= begins:
            same(command, alone.step(rows_of(seen, rows)), rows)
    assert [whole.journal(1), whole.journal(3)] == [alone.journal(0), alone.journal(1)]
    assert len(alone.journal(0)) > 1


def rows_of_command(command, rows):
    pose = Pose(*(each[rows] for each in command.pose))
    return command._replace(
        pose=pose, twist=command.twist[rows], feedforward=command.feedforward[rows], status=command.status[rows]
    )


def test_a_skill_in_a_moved_frame_does_there_what_it_does_in_base():
    """One frame for all, and one for each trial."""
    each = Pose(RNG.normal(size=(4, 3)), rotation_matrix(RNG.normal(size=(4, 3))))
    for frame in (Pose(each.position[0], each.rotation[0]), each):
        plain, moved = made(), Moved(made, frame)
        plain.start(seen_from(frame, OBSERVATIONS[0]), [np.random.default_rng(i) for i in range(4)])
        moved.start(OBSERVATIONS[0], [np.random.default_rng(i) for i in range(4)])
        both = np.zeros((4, 6, 6))
        both[:, :3, :3] = both[:, 3:, 3:] = frame.rotation
        for seen in OBSERVATIONS:
            a, b = plain.step(seen_from(frame, seen)), moved.step(seen)
            np.testing.assert_allclose(
                b.pose.position, rotate(frame.rotation, a.pose.position) + frame.position, atol=1e-12
            )
            np.testing.assert_allclose(b.pose.rotation, frame.rotation @ a.pose.rotation, atol=1e-12)
            np.testing.assert_allclose(b.twist, seen.twist, atol=1e-12)  # the skill's own is what it saw
            np.testing.assert_allclose(b.feedforward, rotate_spatial(frame.rotation, a.feedforward), atol=1e-12)
            np.testing.assert_allclose(
                np.broadcast_to(b.impedance.stiffness, (4, 6, 6)),
                both @ a.impedance.stiffness @ np.swapaxes(both, -1, -2),
                atol=1e-9,
            )
        assert moved.journal(0) == plain.journal(0)
