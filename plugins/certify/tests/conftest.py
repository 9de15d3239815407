"""Campaigns without a simulator, as the core's tests of campaigns make them; workers import them by name."""

import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests" / "unit" / "campaign")]

from tests.unit.campaign.conftest import campaign, out, reference  # noqa: E402

__all__ = ["campaign", "out", "reference"]


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """A folder from its question to a certificate that certifies. Read only; `certified` is a copy."""
    from test_certify import asked, through

    out = asked(tmp_path_factory.mktemp("whole"))
    assert through(out)["predicate"]["certified"]
    return out


@pytest.fixture
def certified(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "out")
    return tmp_path / "out"
