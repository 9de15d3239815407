"""A valley that was shown twice, and what was learned of it. Read only."""

import pytest

from skillframe import learn, record


@pytest.fixture(scope="session")
def demonstrations():
    return record("valley", "free_tool", count=2, seed=1)


@pytest.fixture(scope="session")
def skill(demonstrations):
    return learn(demonstrations)
