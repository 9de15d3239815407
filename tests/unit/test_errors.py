import pytest

from skillframe.errors import UnknownName, suggest

WORLDS = ("corner", "edge", "free", "hose_coupler", "lever", "pallets", "peg_in_hole", "socket", "valley")


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("pegg", "peg_in_hole"),  # "edge" has as many letters in common, but not at its beginning
        ("peg", "peg_in_hole"),
        ("hose", "hose_coupler"),
        ("vally", "valley"),
        ("Valley", "valley"),
        ("egde", "edge"),
        ("peg_in_hold", "peg_in_hole"),
        ("zzz", None),
    ],
)
def test_the_nearest_name_is_suggested_by_the_whole_or_by_its_beginning(typed, meant):
    assert suggest(typed, WORLDS) == meant
    assert (f"did you mean {meant!r}?" in str(UnknownName("world", typed, WORLDS))) == (meant is not None)


def test_of_two_names_with_one_beginning_the_nearer_whole_is_suggested():
    assert suggest("peg", ["peg_in_hole", "pegs"]) == "pegs"


def test_nothing_is_suggested_where_there_is_nothing():
    assert suggest("valley", []) is None


def test_many_names_in_groups_are_listed_by_their_groups():
    groups = [f"{group}.{i}" for group in "abc" for i in range(20)]
    assert str(UnknownName("quantity", "z", groups)) == "unknown quantity 'z' (there are: a.*, b.*, c.*)"
    files = [f"{i}.json" for i in range(40)]
    assert "0.json, 1.json" in str(UnknownName("file", "z", files))
