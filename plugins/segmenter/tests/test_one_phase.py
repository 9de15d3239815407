"""What `segment` says where it finds one phase: never to cut what it has just been asked to cut."""

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import write_demonstration


def curved() -> Demonstration:
    """Half a circle on a table: no one push explains it, and no stretch of it is another phase."""
    time = np.arange(0.0, 8.0, 0.01)
    angle = np.pi * np.clip((time - 1.0) / 6.0, 0.0, 1.0)
    position = 0.05 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    along = np.gradient(position, axis=0)
    on = (np.linalg.norm(along, axis=1) > 0.0)[:, None]
    force = np.where(on, -12.0 * along / np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None], 0.0)
    wrench = np.concatenate([force, 0.0 * force], axis=1) + 0.02 * np.random.default_rng(0).normal(size=(len(time), 6))
    down = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    return Demonstration(time=time, position=position, quaternion=down, wrench=wrench)


@pytest.mark.slow
def test_one_phase_without_a_push_asks_for_the_number_and_one_with_a_push_for_nothing(tmp_path, capsys):
    for name, demonstration, asks in (
        ("curved", curved(), True), ("pushed", next(iter(example_demonstrations())), False),
    ):  # fmt: skip
        write_demonstration(demonstration, tmp_path / f"{name}.npz")
        assert run(["segment", str(tmp_path / f"{name}.npz"), "--out", str(tmp_path / f"{name}.json")]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "1 phase from 1 demonstration" in said
        assert ("say how many (--phases 2)" in said) == asks
        assert "cut it into phases" not in said
