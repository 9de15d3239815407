"""Failures by cause."""

import pytest

from skillframe.campaign.rows import cause_of


@pytest.mark.parametrize(
    ("failure", "cause"),
    [
        ("force limit: 80.1 N is above 80 N (at 2.199 s)", "force limit"),
        ("goal not reached: came to rest, 24 mm from the start", "goal not reached: came to rest"),
        ("link 'l4' is 79 mm inside the fixture (at 1.230 s)", "link 'l4' is inside the fixture"),
        ("worker died (killed)", "worker died (killed)"),
        ("", "no cause given"),
    ],
)  # fmt: skip
def test_failures_are_grouped_without_the_figures_of_each_trial(failure, cause):
    assert cause_of(failure) == cause
