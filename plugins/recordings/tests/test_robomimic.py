"""Demonstrations as robomimic's HDF5: what h5py finds in the file, and back to the last bit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import matrix_from_quaternion, rotation_matrix

h5py = pytest.importorskip("h5py")


def turning(count: int = 40) -> Demonstration:
    """A tool that is led at 0.3 mm a sample and turns by 2 mrad a sample about y, with noise in its wrench."""
    rng, k = np.random.default_rng(3), np.arange(count)
    half = 0.001 * k
    return Demonstration(
        time=k / 300.0, position=k[:, None] * np.array([1e-4, 0.0, -2.8e-4]) + [0.4, 0.1, 0.3],
        quaternion=np.stack([0.0 * half, np.sin(half), 0.0 * half, np.cos(half)], axis=1),
        wrench=rng.standard_normal((count, 6)), extra={"grip": rng.standard_normal(count)},
        meta={"task": "peg", "rate": 300.0, "frames": {"tip": [0.0, 0.0, 0.2]}, "robot": "panda"},
    )  # fmt: skip


@pytest.fixture
def written(tmp_path: Path) -> Path:
    write_demonstration(turning(), tmp_path / "peg.hdf5")
    return tmp_path / "peg.hdf5"


def test_it_comes_back_to_the_last_bit_with_its_metadata(written: Path) -> None:
    d, found = turning(), read_demonstration(written)
    for name in ("time", "position", "wrench"):
        np.testing.assert_array_equal(getattr(found, name), getattr(d, name))
    np.testing.assert_allclose(found.quaternion, d.quaternion, rtol=0, atol=2**-53)  # the reader makes its norm 1 again
    np.testing.assert_array_equal(found.extra["grip"], d.extra["grip"])
    assert {key: found.meta[key] for key in d.meta} == d.meta


def test_the_file_has_the_groups_and_attributes_that_robomimic_documents(written: Path) -> None:
    count = len(turning())
    with h5py.File(written) as file:
        assert file["data"].attrs["total"] == file["data/demo_0"].attrs["num_samples"] == count
        assert json.loads(file["data"].attrs["env_args"]) == {"env_name": "peg", "type": 2, "env_kwargs": {}}
        demo = file["data/demo_0"]
        assert {"actions", "rewards", "dones", "states", "obs", "next_obs"} <= set(demo)
        assert all(len(demo[name]) == count for name in ("actions", "rewards", "dones", "states"))
        assert demo["dones"][:].tolist() == [0] * (count - 1) + [1]
        for name, values in demo["obs"].items():
            if name != "further":
                np.testing.assert_array_equal(demo["next_obs"][name][:-1], values[1:])
        assert np.abs(demo["actions"][:]).max() <= 1.0  # what robomimic asks of actions


def test_actions_lead_from_each_pose_to_the_next(written: Path) -> None:
    d = turning()
    with h5py.File(written) as file:
        actions = file["data/demo_0/actions"][:]
    rotation = matrix_from_quaternion(d.quaternion)
    np.testing.assert_allclose(d.position[:-1] + 0.05 * actions[:-1, :3], d.position[1:], atol=1e-15)
    np.testing.assert_allclose(rotation_matrix(0.5 * actions[:-1, 3:]) @ rotation[:-1], rotation[1:], atol=1e-12)
    np.testing.assert_array_equal(actions[-1], 0.0)


def test_named_columns_win_and_what_is_damaged_is_a_sentence(written: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        read_demonstration(written, columns="t=nowhere")
    with h5py.File(written, "a") as file:
        del file["data/demo_0/obs/robot0_ee_force"]
    with pytest.raises(InputError, match=r"lacks obs/robot0_ee_force\[0\]; write it again"):
        read_demonstration(written)
    with h5py.File(written, "a") as file:
        file["data/demo_0"].attrs["skillframe"] = '{"format": "skillframe.demonstration", "version": 7, "meta": {}}'
    with pytest.raises(InputError, match="of version 1; update skillframe"):
        read_demonstration(written)
