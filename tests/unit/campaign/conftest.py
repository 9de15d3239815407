import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # worker processes import the fakes by name


@pytest.fixture
def campaign(tmp_path):
    """Writes a campaign file with two (empty) skill files beside it, and gives its path."""
    from campaign_fakes import write_campaign

    return lambda **changes: write_campaign(tmp_path, **changes)
