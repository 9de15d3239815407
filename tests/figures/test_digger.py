"""A digger of 1.5 t by own-crane.md, gains derived from its figures: of 200 landings on wood none bounces.

Friction +-20 %, masses +-2 %, starts +-0.1 m, sensors' noise. With the gains of the crane that ships the same digger
swings by itself (plugins/hydraulics/tests/test_gains.py, plugins/hydraulics/tests/test_ringing.py).
"""

import numpy as np
import pytest

from tests.digger import FORCE_LIMIT, write_digger
from tests.digger_landing import landing, press
from tests.figures.teaching import row

pytestmark = pytest.mark.figures

TRIALS, CHUNK, SEED = 200, 20, 700


def test_no_landing_of_a_digger_with_default_gains_bounces_and_every_one_ends_in_the_corner(tmp_path):
    robot, seen, good = write_digger(tmp_path / "digger"), [], []
    for chunk in range(TRIALS // CHUNK):
        result = press(robot, CHUNK, SEED + chunk)
        seen += [landing(trace) for trace in result.traces]
        good += result.success.tolist()
    bounces, speed, force = np.array(seen).T
    row(
        f"digger with derived gains, {TRIALS} landings on wood",
        f"{int(sum(good))} in the corner, {int(bounces.sum())} bounces beyond the landing",
        f"tool at most {speed.max():.2f} m/s, truly {force.max() / 1e3:.1f} kN (allowed {FORCE_LIMIT / 1e3:g})",
    )  # fmt: skip
    assert all(good)
    assert bounces.max() == 0
    assert force.max() < FORCE_LIMIT
