import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # worker processes import the fakes by name


@pytest.fixture
def campaign(tmp_path):
    """Writes a campaign file with two (empty) skill files beside it, and gives its path."""
    from campaign_fakes import write_campaign

    return lambda **changes: write_campaign(tmp_path, **changes)


@pytest.fixture
def out(campaign, tmp_path):
    """The folder of a campaign of 48 trials that is ready to run."""
    from campaign_fakes import start

    return start(campaign(trials=48), tmp_path / "out")


@pytest.fixture
def reference(campaign, tmp_path):
    """The table of an undisturbed run, by number of trials."""
    from campaign_fakes import run, start, table

    def of(trials):
        folder = start(campaign(trials=trials), tmp_path / "reference")
        run(folder, traces=0)
        return table(folder)

    return of
