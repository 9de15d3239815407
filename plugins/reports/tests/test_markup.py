import json
import math
from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st
from skillframe_reports.markup import Markup, json_script, number, percent, tag


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.text, self.attributes = [], "", []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.text += data


def read(markup):
    reader = Reader()
    reader.feed(markup)
    reader.close()
    return reader


plain = st.text(st.characters(blacklist_categories=("Cs", "Cc")))


@given(plain)
def test_any_text_comes_back_as_text_and_makes_no_element(text):
    reader = read(tag("p", text, title=text))
    assert reader.tags == ["p"]
    assert reader.text == text
    assert reader.attributes == [("title", text)]


@given(st.dictionaries(plain, plain))
def test_data_for_the_script_cannot_close_its_element(values):
    block = json_script("x", values)
    assert block.count("</script>") == 1
    assert json.loads(block[block.index(">") + 1 : -len("</script>")]) == values


def test_markup_passes_unchanged():
    assert tag("p", Markup("<b>x</b>"), "<b>") == "<p><b>x</b>&lt;b&gt;</p>"


@given(st.floats(min_value=0.0, max_value=1.0))
def test_a_share_is_never_rounded_onto_certainty(share):
    assert (percent(share) == "100 %") == (share == 1.0)
    assert (percent(share) == "0 %") == (share == 0.0)


@given(st.floats(min_value=1e-4, max_value=9.9e5))
def test_a_figure_keeps_three_significant_digits(value):
    shown = float(number(value))
    assert math.isclose(shown, value, rel_tol=5.1e-3)  # half a unit of the third digit is at most 5e-3 of the value
