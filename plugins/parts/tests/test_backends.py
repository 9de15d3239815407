"""Which contact a pair of parts gets: exact pieces, else surfaces, else pieces that are exact enough, or as asked."""

from types import SimpleNamespace

import pytest
from skillframe_parts import load
from skillframe_parts.load import PreparedPart
from skillframe_parts.pieces import ConvexPieces

from skillframe.errors import InputError

PLUG, SOCKET = (SimpleNamespace(name=name) for name in ("plug.stl", "socket.stl"))
SOLID = SimpleNamespace(num_tri=lambda: 9)
FOUND = SimpleNamespace(clearance=4e-4, plug=SOLID, socket=SOLID)


@pytest.fixture
def parts(monkeypatch):
    """Parts by the errors of exact and of thinned pieces and of surfaces, and whether these can be built."""

    def stand(exact, thinned, surface=1.5e-5, compiler=True):
        def in_pieces(_, found, allowed, most):
            error = thinned if allowed else exact
            return PreparedPart(None, error, ConvexPieces([None] * 4, error, "z", bool(allowed)))

        def as_surface(part, _, found):
            if surface > found.clearance / 4:
                raise InputError(part.name, "is off", "draw it again")
            return PreparedPart(None, surface, surface=object())

        for name, value in (("_in_pieces", in_pieces), ("_as_surface", as_surface), ("available", lambda: compiler)):
            monkeypatch.setattr(load, name, value)
        return lambda by="auto": load._prepared(PLUG, SOCKET, FOUND, by)

    return stand


def kind(pair):
    one, two = pair
    assert (one.pieces is None) == (two.pieces is None) and (one.surface is None) == (two.surface is None)
    return "surface" if one.pieces is None else "thinned" if one.pieces.thinned else "pieces"


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({"exact": 9e-6, "thinned": 9e-6}, "pieces"),
        ({"exact": 1.1e-5, "thinned": 1.1e-5}, "surface"),  # 10 um are exact
        ({"exact": float("inf"), "thinned": 8e-5}, "surface"),  # a surface is off by less
        ({"exact": float("inf"), "thinned": 8e-5, "surface": 2e-4}, "thinned"),
        ({"exact": float("inf"), "thinned": 8e-5, "compiler": False}, "thinned"),
        ({"exact": 0.0, "thinned": 0.0, "compiler": False}, "thinned"),
    ],
)
def test_the_contact_of_a_pair_is_the_most_exact_there_is(parts, found, expected):
    assert kind(parts(**found)()) == expected


def test_a_file_that_asks_for_one_contact_gets_it_or_a_sentence(parts):
    assert kind(parts(exact=0.0, thinned=0.0)("surface")) == "surface"
    assert kind(parts(exact=1.0, thinned=8e-5)("pieces")) == "thinned"
    for found, by, sentence in (
        ({"exact": 0.0, "thinned": 0.0, "surface": 2e-4}, "surface", "plug.stl: is off; draw it again"),
        ({"exact": 0.0, "thinned": 0.0, "compiler": False}, "surface", 'contact.by: is "surface", and there is no C'),
        ({"exact": 0.0, "thinned": 2e-4}, "pieces", 'clearance of 0.4 mm, and contact.by is "pieces"'),
        ({"exact": 1.0, "thinned": 2e-4, "surface": 2e-4}, "auto", "clearance of 0.4 mm, and as a surface is off"),
    ):
        with pytest.raises(InputError) as caught:
            parts(**found)(by)
        assert sentence in str(caught.value)
