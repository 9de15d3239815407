"""Theory's border stands where theory says: measured in the picture itself, against points whose data are known.

A map draws trial t at its own values. Two of them fix the scale of the picture, which turns the border's place in the
picture back into degrees; nothing of the drawing's own arithmetic is used.
"""

import math
import re

import pytest
from skillframe_reports.convergence import cell_map, rate_curves
from skillframe_reports.results import read_results
from skillframe_reports.theory import regions

from tests.report_fakes import write_csv

TILT, FRICTION = "fixture.tilt_y", "world.friction"
LIMIT = 0.25  # rad
OVER = {"values": [0.1, 0.2, 0.4], "largest_tilt_rad": [0.3, 0.25, 0.1]}


@pytest.fixture(params=[(TILT, FRICTION), (FRICTION, TILT)], ids=["tilt across", "tilt up"])
def names(request):
    return request.param


@pytest.fixture
def results(tmp_path):
    """25 trials on a lattice, tilt -0.4 .. 0.4 rad, friction 0.05 .. 0.45."""
    lattice = [(-0.4 + 0.2 * i, 0.05 + 0.1 * k) for i in range(5) for k in range(5)]
    rows = [[trial, "a", 1, tilt, friction, 1, ""] for trial, (tilt, friction) in enumerate(lattice)]
    write_csv(tmp_path / "results.csv", rows, ["trial", "skill", "seed", TILT, FRICTION, "success", "failure"])
    return read_results(tmp_path / "results.csv", [TILT, FRICTION])


def border(over=None):
    scene = {"analytic": {"largest_tilt_rad": LIMIT}, "analytic_over": {FRICTION: over} if over else {}}
    return regions(scene, [TILT, FRICTION])


def scale(drawn, results, names):
    """Turns a place in the picture into (tilt, friction), from the first and the last trial's point."""
    point = r'<circle cx="([-\d.]+)" cy="([-\d.]+)"[^>]*><title>trial {}:'
    first, last = (tuple(map(float, re.search(point.format(t), drawn).groups())) for t in (0, 24))
    ends = [(results.rows[t].values[names[0]], results.rows[t].values[names[1]]) for t in (0, 24)]

    def data(x, y):
        place = [
            a + (p - u) / (v - u) * (b - a) for p, u, v, a, b in zip((x, y), first, last, ends[0], ends[1], strict=True)
        ]
        return place if names[0] == TILT else place[::-1]

    return data


def lines(drawn):
    """Ends of the dashed straight lines."""
    found = [dict(re.findall(r'(\w+)="([-\d.]+)"', tag)) for tag in re.findall(r"<line [^>]*theory\"[^>]*>", drawn)]
    return [((float(f["x1"]), float(f["y1"])), (float(f["x2"]), float(f["y2"]))) for f in found]


def curves(drawn):
    paths = [re.search(r' d="([^"]+)"', tag)[1] for tag in re.findall(r"<path [^>]*theory\"[^>]*>", drawn)]
    return [[tuple(map(float, pair.split())) for pair in re.split("[ML]", path) if pair] for path in paths]


def test_the_straight_border_on_a_map_is_at_plus_and_minus_the_limit(results, names):
    drawn = str(cell_map(results, "a", names, border()))
    data = scale(drawn, results, names)
    found = sorted(lines(drawn), key=lambda ends: data(*ends[0])[0])
    assert len(found) == 2
    for ends, limit in zip(found, (-LIMIT, LIMIT), strict=True):
        for end in ends:
            assert data(*end)[0] == pytest.approx(limit, abs=0.001)  # 0.15 of some 350 pixels over 1 rad
    span = abs(data(*found[0][0])[1] - data(*found[0][1])[1])
    assert span == pytest.approx(0.5, abs=0.001)  # over all five cells of friction


def test_the_curved_border_on_a_map_follows_the_limit_at_each_friction(results, names):
    drawn = str(cell_map(results, "a", names, border(OVER)))
    data = scale(drawn, results, names)
    assert len(curves(drawn)) == 2
    for sign, curve in zip((-1.0, 1.0), curves(drawn), strict=True):
        points = [data(*point) for point in curve]
        assert [p[1] for p in points] == pytest.approx(OVER["values"], abs=0.001)
        assert [p[0] for p in points] == pytest.approx([sign * v for v in OVER["largest_tilt_rad"]], abs=0.001)


def ticks(drawn):
    """(degrees, place) of the labels under a curve's axis."""
    found = re.findall(r'<text x="([-\d.]+)" y="215(?:\.0)?"[^>]*>([-−\d.]+)</text>', drawn)
    return [(float(label.replace("−", "-")), float(x)) for x, label in found]


def test_the_border_on_a_curve_of_the_rate_is_at_the_limit_in_degrees(results):
    drawn = str(rate_curves(results, TILT, border()))
    (low, left), *_, (high, right) = ticks(drawn)
    places = sorted(low + (ends[0][0] - left) / (right - left) * (high - low) for ends in lines(drawn))
    assert places == pytest.approx([-math.degrees(LIMIT), math.degrees(LIMIT)], abs=0.05)  # a tenth of a pixel


def test_the_band_on_a_curve_of_the_rate_spans_the_limits_over_what_varied(results):
    drawn = str(rate_curves(results, TILT, border(OVER)))
    (low, left), *_, (high, right) = ticks(drawn)
    bands = [dict(re.findall(r'(\w+)="([-\d.]+)"', tag)) for tag in re.findall(r"<rect [^>]*theory-band[^>]*>", drawn)]
    edges = sorted(float(b["x"]) + more for b in bands for more in (0.0, float(b["width"])))
    found = [low + (x - left) / (right - left) * (high - low) for x in edges]
    assert found == pytest.approx([math.degrees(v) for v in (-0.3, -0.1, 0.1, 0.3)], abs=0.05)
