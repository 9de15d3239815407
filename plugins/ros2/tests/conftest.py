import os
import sys
from pathlib import Path

DRIVE = Path(__file__).resolve().parents[2] / "drive" / "tests"
sys.path[:0] = [str(DRIVE), str(Path(__file__).parent)]
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)  # of this process's own, and of those that it starts

from plugins.drive.tests.conftest import valley_skill  # noqa: E402

__all__ = ["valley_skill"]
