"""Convex pieces from the cache are those that were cut, and a damaged entry costs a warning alone."""

import numpy as np
import pytest
from skillframe_parts import piece_cache as kept
from skillframe_parts import pieces

from skillframe.errors import SkillframeWarning
from tests.part_meshes import hole, in_metres

PART, ALLOWED = in_metres(hole(5.2, 12.0, 24)), 2e-5


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "skillframe" / "pieces"


def same(one, two):
    assert one[1:] == two[1:] and len(one.hulls) == len(two.hulls)
    for a, b in zip(one.hulls, two.hulls, strict=True):
        for mine, theirs in zip(a, b, strict=True):
            np.testing.assert_array_equal(mine, theirs, strict=True)


@pytest.mark.slow
def test_pieces_from_the_cache_are_the_same_to_the_bit_and_are_not_cut_again(monkeypatch):
    true = pieces.pieces_of(PART, ALLOWED)
    same(kept.pieces_of(PART, ALLOWED), true)
    monkeypatch.setattr(pieces, "pieces_of", lambda *_: pytest.fail("cut again"))
    same(kept.pieces_of(PART, ALLOWED), true)


@pytest.mark.slow
def test_another_part_another_error_and_another_limit_are_cut_anew(cache):
    kept.pieces_of(PART, ALLOWED)
    kept.pieces_of(PART, 2.0 * ALLOWED)
    kept.pieces_of(PART.translate([1e-4, 0.0, 0.0]), ALLOWED)
    assert np.isinf(kept.pieces_of(PART, ALLOWED, 3).error)  # that there are too many is kept as well
    assert len(list(cache.iterdir())) == 4


@pytest.mark.parametrize("damage", [b"", b"{", b"null", b'{"hulls": [[1]]}', b'{"hulls": [], "error": "?"}'])
@pytest.mark.slow
def test_a_damaged_entry_is_made_again_with_a_sentence(cache, damage):
    true = kept.pieces_of(PART, ALLOWED)
    (entry,) = cache.iterdir()
    entry.write_bytes(damage)
    with pytest.warns(SkillframeWarning, match="was damaged, so the part was cut again"):
        same(kept.pieces_of(PART, ALLOWED), true)
    same(kept.pieces_of(PART, ALLOWED), true)  # no warning: it was written again
