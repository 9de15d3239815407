"""A part that is screwed in: a bayonet with a steep lead-in and a level lock, as two meshes and a fixture file."""

import shutil

import numpy as np
import pytest
from skillframe_parts.load import load

from skillframe.errors import InputError
from skillframe.execution.prepare import load_world
from skillframe.frames import Pose, quaternion_from_matrix
from skillframe.world.scene import State
from tests.second_meshes import made


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return made("bayonet", tmp_path_factory.mktemp("turns"))


def test_it_comes_out_by_its_turns_and_not_straight(path, tmp_path):
    found = load(path).fit
    assert found.depth == pytest.approx(0.008, abs=1e-6) and found.way.turns[-1] == pytest.approx(np.radians(-24.0))
    assert 2e-4 < found.clearance < 5e-4
    whole = path.read_text()
    straight = copied(path, tmp_path / "straight", whole.split("[task]")[0])
    with pytest.raises(InputError, match=r"cannot leave socket.stl along.*or task.turns of a part that is screwed in"):
        load(straight)
    wrong = copied(path, tmp_path / "wrong", whole.replace("-18deg", "18deg").replace("-24deg", "24deg"))
    with pytest.raises(InputError, match=r"by task.turns: .*or other turns"):
        load(wrong)


def copied(path, folder, text):
    """The same meshes beside another text."""
    shutil.copytree(path.parent, folder)
    (folder / path.name).write_text(text)
    return folder / path.name


@pytest.mark.slow
def test_it_begins_turned_back_and_is_seated_once_it_is_turned(path):
    scene = load_world(str(path), {})
    down = np.diag([1.0, -1.0, -1.0])

    def about(degrees):
        a = np.radians(degrees)
        return np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]]) @ down

    start = quaternion_from_matrix(about(-24.0))
    assert abs(np.dot(start, scene.start_quaternion)) == pytest.approx(1.0, abs=1e-12)
    angles = [0.0, -2.0, 2.0, -4.0, 4.0, -24.0]
    tips = Pose(np.tile([0.0, 0.0, -0.008], (6, 1)), np.array([about(a) for a in angles]))
    state = State(tips, np.zeros((6, 6)))
    np.testing.assert_array_equal(scene.goal(state), [True, True, True, False, False, False])  # 0.05 rad = 2.9 degrees
    np.testing.assert_allclose(scene.goal_error(state)[1], np.radians(np.abs(angles)), atol=1e-12)


def test_turns_that_do_not_rise_are_refused(path, tmp_path):
    falling = copied(path, tmp_path / "falling", path.read_text().replace('"8mm"', '"0.1mm"'))
    with pytest.raises(InputError, match=r"task.turns: do not rise; give the lowest lift first"):
        load(falling)
