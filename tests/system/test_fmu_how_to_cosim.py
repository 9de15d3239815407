"""What docs/how-to/own-fmu.md shows of co-simulation is run, and its mass ends where the oil puts it."""

import re
from pathlib import Path

import pytest

from skillframe.fmu.build import find_compiler

WHOLE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-fmu.md").read_text(encoding="utf-8")
PAGE = WHOLE.partition("\n## 5. Couple mechanics and FMUs yourself\n")[2]


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_the_python_of_the_page_runs(capsys):
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "own-fmu.md", "exec"), names)
    out = capsys.readouterr().out.rstrip()
    assert out.endswith("{}")  # no trouble
    assert re.search(r"prints `(.*), residual", PAGE).group(1) in out
    mass, master = names["mass"], names["master"]
    assert 0.3 < mass.position[0] < 0.59
    # speed is the valve's flow over the piston's area once the oil has settled, to its compression
    area = 3.14159265 / 4 * 0.08**2
    assert mass.velocity[0] == pytest.approx(names["bank"].y[0, 5] / area, rel=0.02)
    assert master.residual[0] < 3e-4
