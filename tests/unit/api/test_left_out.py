"""What each demonstration contributes: learned again without it."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.api.leave_one_out import Found, said
from skillframe.cli.main import run
from skillframe.extend.reading import write_demonstration
from skillframe.frames import rotation_matrix

DOWN = np.array([0.0, 0.0, -1.0])
ASIDE = rotation_matrix([radians(12.0), 0.0, 0.0]) @ DOWN


@pytest.mark.parametrize(
    ("whole", "without", "words"),
    [
        (Found(DOWN, 0.1, 0.1), Found(ASIDE, 0.1, 0.1), "a.npz agrees: without it the push turns by 12 degrees"),
        (Found(DOWN, 0.1, 0.1), Found(DOWN, 0.1, 0.1, open=True), "a.npz is needed: without it all others went one"),
        (Found(DOWN, 0.1, 0.1, open=True), Found(DOWN, 0.1, 0.1, open=True), "a.npz agrees"),
        (Found(DOWN, 0.1, 0.1), Found(None, None, None), "a.npz is needed: without it there is no push"),
        (Found(None, None, None), Found(DOWN, 0.1, 0.1), "a.npz contradicts the others: without it there is a push"),
        (Found(None, None, None), Found(None, None, None), ""),
        (Found(DOWN, 0.6, 0.1), Found(DOWN, 0.9, 0.1), "explains 60 % of what was shown, without it 90 %; "),
        (Found(DOWN, 0.8, 0.1), Found(DOWN, 0.9, 0.1), "a.npz agrees: without it the push turns by 0"),
        (Found(DOWN, 0.1, radians(5)), Found(DOWN, 0.1, radians(30)), "known to about 5 degrees, without it to 30; "),
    ],
)
def test_each_case_has_its_sentence(whole, without, words):
    text = said("a.npz", "push", whole, without)
    assert words in text
    assert bool(text) == bool(words)


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_the_demonstration_from_the_other_side_is_needed_and_its_opposite_contradicts(tmp_path, capsys):
    left, right = example_demonstrations()
    against = replace(  # pulled up and away where the others were pushed down
        left, position=2.0 * left.position[0] - left.position, wrench=-left.wrench, source="against"
    )
    files = {"left": left, "right": right, "against": against}
    for name, demonstration in files.items():
        write_demonstration(demonstration, tmp_path / f"{name}.npz")

    def told(*names):
        paths = [str(tmp_path / f"{name}.npz") for name in names]
        code = run(["learn", *paths, "--leave-one-out", "--out", str(tmp_path / "s.json")])
        return code, capsys.readouterr()

    code, out = told("left", "right")
    lines = [line for line in out.out.splitlines() if "without it" in line]
    assert code == 0
    assert len(lines) == 2  # either side by itself leaves the direction open
    assert all("is needed" in line for line in lines)
    _, out = told("left", "right", "against")
    assert "against.npz contradicts the others" in out.out
    code, out = told("left")
    assert code == 2
    assert "there is one" in out.err
    (tmp_path / "s.json").unlink()
    code = run(["learn", str(tmp_path / "left.npz"), str(tmp_path / "right.npz"), "--skill", "gmr", "--leave-one-out",
                "--out", str(tmp_path / "s.json")])  # fmt: skip
    assert code == 2
    assert "gmr is not one motion with a direction" in capsys.readouterr().err
    assert not (tmp_path / "s.json").exists()
