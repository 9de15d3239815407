from collections import Counter
from contextlib import redirect_stdout
from io import StringIO

import click
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skillframe.campaign.runner import Progress
from skillframe.cli.output import campaign_progress, laid_out, note, progress, quiet_option, table


def test_long_work_in_a_pipe_says_a_line_per_tenth_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("frames") as show:
        for done in range(1, 101):
            show(done, 100)
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == [f"{done} of 100 frames" for done in (1, *range(10, 101, 10))]


def test_work_that_is_over_soon_says_nothing_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("s simulated", after_s=3600.0) as show:
        show(0.5, 1.0)
    assert capsys.readouterr().err == ""


WORDS = st.lists(st.text("abc-.", min_size=1, max_size=30), max_size=30).map(" ".join)


@given(
    st.lists(st.lists(WORDS, min_size=4, max_size=4), min_size=1, max_size=5), st.integers(40, 120)
)  # "three: " and a word of 30 fit in 40
def test_a_table_of_a_width_keeps_it_and_never_breaks_a_word(rows: list[list[str]], width: int) -> None:
    lines = list(laid_out(("one", "two", "three", "four"), rows, width))
    assert max(map(len, lines)) <= width
    shown = Counter(word for line in lines[1:] for word in line.split())
    headings = {"one:", "two:", "three:", "four:"}
    assert Counter({w: n for w, n in shown.items() if w not in headings}) == Counter(
        word for row in rows for cell in row for word in cell.split()
    )


@given(st.lists(st.lists(WORDS, min_size=4, max_size=4), min_size=1, max_size=5))
@pytest.mark.slow
def test_a_table_of_a_width_keeps_every_cell_in_its_column_where_its_words_fit(rows: list[list[str]]) -> None:
    width = 4 * 30 + 3 * 2  # four words of the longest kind, and the gaps
    out = StringIO()
    with redirect_stdout(out):
        table(("one", "two", "three", "four"), rows, width)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    starts = [lines[0].index(head) for head in ("one", "two", "three", "four")]
    columns = [slice(a, b) for a, b in zip(starts, [*starts[1:], None], strict=True)]
    said = ["".join(line[column] for line in lines[1:]).replace(" ", "") for column in columns]
    assert said == ["".join(row[i] for row in rows).replace(" ", "") for i in range(4)]


def test_a_table_that_fits_its_width_has_a_line_per_row(capsys: pytest.CaptureFixture[str]) -> None:
    table(("name", "what"), [["a", "x y"], ["b", "z"]], 12)
    assert capsys.readouterr().out.splitlines() == ["name  what", "a     x y", "b     z"]


@pytest.mark.parametrize("nothing_in_colour", [True, False])
def test_headings_are_bold_on_a_terminal_unless_no_color_is_set(
    monkeypatch: pytest.MonkeyPatch, nothing_in_colour: bool
) -> None:
    class Terminal(StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1" if nothing_in_colour else "")
    monkeypatch.setenv("COLUMNS", "40")
    out = Terminal()
    with redirect_stdout(out):
        table(("name", "what"), [["a", "some words that do not fit in a line of forty"]])
    said = out.getvalue()
    assert ("\x1b" in said) != nothing_in_colour
    assert max(map(len, said.splitlines()[1:])) <= 40


def test_quiet_work_says_nothing_of_how_far_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    @click.command()
    @quiet_option
    def work() -> None:
        note("a note")
        with progress("frames") as show:
            show(1, 1)

    work.main(["-q"], standalone_mode=False)
    assert capsys.readouterr().err == ""
    work.main([], standalone_mode=False)
    assert capsys.readouterr().err == "a note\n1 of 1 frames\n"


def test_a_quiet_campaign_says_what_is_unusual_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    @click.command()
    @quiet_option
    def work() -> None:
        with campaign_progress() as notify:
            notify(Progress(1, 4))
            notify(Progress(1, 4, "worker 1 was ended: memory"))
            notify(Progress(4, 4, "2 of them run again, to leave traces", usual=True))

    work.main(["-q"], standalone_mode=False)
    assert capsys.readouterr().err == "worker 1 was ended: memory\n"
    work.main([], standalone_mode=False)
    assert len(capsys.readouterr().err.splitlines()) == 4
