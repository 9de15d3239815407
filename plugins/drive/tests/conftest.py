import sys
from pathlib import Path

import pytest

import skillframe

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def valley_skill(tmp_path_factory):
    """A skill file, learned in the valley from two demonstrations."""
    folder = tmp_path_factory.mktemp("valley")
    recorded = skillframe.record("valley", count=2, seed=3)
    path = folder / "valley.skill.json"
    skillframe.learn(recorded).save(path)
    return path
