import sys
from pathlib import Path

DRIVE = Path(__file__).resolve().parents[2] / "drive" / "tests"
sys.path[:0] = [str(DRIVE), str(Path(__file__).parent)]

from plugins.drive.tests.conftest import valley_skill  # noqa: E402

__all__ = ["valley_skill"]
