import pytest

from skillframe.cli.output import progress


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
