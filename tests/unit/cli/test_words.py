"""Descriptions on a screen: broken at semicolons, never reworded."""

from hypothesis import given
from hypothesis import strategies as st

from skillframe.cli.words import laid_out

PHRASES = st.lists(st.text("ab (),", min_size=1, max_size=60), min_size=1, max_size=5)


@given(st.lists(st.tuples(st.sampled_from(["", "translation: ", "phase 1: note: "]), PHRASES), max_size=4))
def test_the_layout_rewords_nothing(lines):
    texts = [label + "; ".join(phrases) for label, phrases in lines]
    shown = " ".join(laid_out(texts)).replace("phase 1", "").split()
    assert shown == " ".join(texts).replace("phase 1:", "").split()


def test_a_long_line_is_broken_below_what_it_is_about_but_not_inside_parentheses():
    told = f"translation: desired direction (one; two), {60 * 'x'}; compliant axis (three); stiffness {20 * 'y'}"
    assert list(laid_out([told])) == [
        f"translation: desired direction (one; two), {60 * 'x'};",
        "             compliant axis (three);",
        f"             stiffness {20 * 'y'}",
    ]


def test_the_sentence_that_sums_a_skill_up_stays_one_line_however_long():
    told = "; ".join(["push along (0.71, 0.00, -0.71) at 80 mm/s", "free along (0.71, 0.00, 0.71) and y", 80 * "x"])
    assert list(laid_out([told])) == [told]


def test_a_phase_has_one_heading():
    told = ["policy of 2 phases", "phase 1: held", "phase 1: note: none", "phase 2: held"]
    assert list(laid_out(told)) == ["policy of 2 phases", "phase 1", "  held", "  note: none", "phase 2", "  held"]
