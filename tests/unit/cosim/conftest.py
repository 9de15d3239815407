import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from tests import fmu_cache

compiler, own_cache = fmu_cache.compiler, fmu_cache.own_cache
