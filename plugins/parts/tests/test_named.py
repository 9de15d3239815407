"""Part files that are named where a world is asked for."""

import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.extend.registry import load_registry


def test_a_part_that_is_named_as_a_world_says_how_it_becomes_one():
    known = load_registry()
    for name in ("plug.stl", "folder/PLUG.STEP", "scene.xml"):
        with pytest.raises(InputError, match="is a part, not a world; make one of two parts, skillframe worlds new"):
            known.world(name)
    with pytest.raises(UnknownName):
        known.world("peg.in.hole")
