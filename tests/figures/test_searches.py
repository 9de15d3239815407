"""How near searches come to the truth, and in how many trials: borders beside Sobol points, breaking points, ranks.

Truths are closed forms over [-1, 1]^d. The error of a border is the volume where the predicted and the true set differ
over the volume of the true one. Sobol points beside it: the same surrogate from as many of them.
"""

from heapq import heapify, heappop, heappush
from itertools import islice

import numpy as np
import pytest
from scipy.stats import qmc
from skillframe_certify import border, breaking_point, sensitivity
from skillframe_certify.engine import Looked
from skillframe_certify.question import LOOKS
from skillframe_certify.surrogate import Surrogate

from tests.figures.teaching import row
from tests.figures.test_certify import Truth

pytestmark = pytest.mark.figures
SEED = 2026_11_23
SOFT = 20


def sobol(dimension, seed):
    return 2.0 * qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng([SEED, seed])).random(4096) - 1.0


def ellipsoid(points):
    return np.sum((points / np.array([0.8, 0.5, 0.7, 0.9])[: points.shape[1]]) ** 2, axis=1) < 1.0


def lobes(points):
    centre = np.zeros(points.shape[1])
    centre[:2] = 0.45
    near = np.sum(((points - centre) / 0.4) ** 2, axis=1), np.sum(((points + centre) / 0.35) ** 2, axis=1)
    return np.minimum(*near) < 1.0


def wedge(points):
    """8 % of the range's width for each unit of x, and thinner towards one end."""
    return np.abs(points[:, 1] - 0.3 * points[:, 0]) < 0.08 * (points[:, 0] + 1.1)


def turned_box(points):
    """A box with sides of 1.2, 0.8 and 1.4, turned by 25 degrees about the last axis, so that it has edges."""
    c, s = np.cos(np.radians(25.0)), np.sin(np.radians(25.0))
    along = points.copy()
    along[:, 0], along[:, 1] = c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]
    return np.all(np.abs(along) < np.array([0.6, 0.4, 0.7])[: points.shape[1]], axis=1)


def error(points, truth):
    even = np.random.default_rng(SEED).uniform(-1.0, 1.0, (20_000, points.shape[1]))
    there = truth(even)
    return float(np.mean((Surrogate(points, truth(points)).mean(even) > 0.0) != there) / there.mean())


def mapped(truth, dimension, seed):
    """Trials, whether it settled, its error and that of as many Sobol points, first trials within 5 and 10 %."""
    points, within = sobol(dimension, seed), {}
    seen = points[: LOOKS[dimension]]
    search = border.search(
        Looked(seen, truth(seen)), len(seen), lambda a, b: points[a:b], border.BUDGET[dimension]
    )  # fmt: skip
    try:
        batch = next(search)
        while True:
            seen = np.concatenate([seen, batch.points])
            off = error(seen, truth)
            for share in (0.05, 0.1):
                if off <= share:
                    within.setdefault(share, len(seen))
            batch = search.send(Looked(batch.points, truth(batch.points)))
    except StopIteration as end:
        first = [within.get(share, np.inf) for share in (0.05, 0.1)]
        return len(seen), end.value.settled, error(seen, truth), error(points[: len(seen)], truth), *first


@pytest.mark.parametrize(
    ("truth", "dimension", "seeds", "most"),
    [
        (ellipsoid, 2, 20, 0.05), (lobes, 2, 20, 0.05), (wedge, 2, 20, 0.05), (turned_box, 2, 20, 0.05),
        (ellipsoid, 3, 5, 0.05), (lobes, 3, 3, 0.05), (turned_box, 3, 3, None), (ellipsoid, 4, 1, 0.1),
        (lobes, 4, 1, None),
    ],
)  # fmt: skip
def test_a_border_is_found_with_half_the_error_of_sobol_points(truth, dimension, seeds, most):
    found = [mapped(truth, dimension, seed) for seed in range(seeds)]
    trials, settled, errors, beside, five, ten = (np.array(column) for column in zip(*found, strict=True))
    row(
        f"{truth.__name__}, {dimension}-D, {seeds} seeds", f"{np.median(trials):.0f} trials, {settled.sum()} settled",
        f"error {np.median(errors):.3f} (worst {errors.max():.3f}), {np.sum(errors <= 0.05)} within 5 %",
        f"within 5 % from {np.median(five):.0f}, 10 % from {np.median(ten):.0f}; Sobol {np.median(beside):.3f}",
    )  # fmt: skip
    assert np.median(errors) < 0.5 * np.median(beside)
    assert most is None or np.mean(errors <= most) >= 0.9


def test_what_a_search_says_it_may_have_wrong_is_what_it_has_wrong_where_borders_are_soft():
    """Truths of `test_certify`: success falls over a soft edge, and up to 7 % of failures come anywhere."""
    even, found = np.random.default_rng(SEED).uniform(-1.0, 1.0, (20_000, 2)), []
    for seed in range(SOFT):
        rng = np.random.default_rng([SEED, seed, 2])
        truth, points = Truth(rng, 2), sobol(2, 100 + seed)
        works = rng.random(len(points)) < truth(points)
        seen = Looked(points[: LOOKS[2]], works[: LOOKS[2]])
        search, used = border.search(seen, LOOKS[2], lambda a, b, p=points: p[a:b], border.BUDGET[2]), seen
        try:
            batch = next(search)
            while True:
                ended = Looked(batch.points, rng.random(len(batch.points)) < truth(batch.points))
                used = used.with_more(ended)
                batch = search.send(ended)
        except StopIteration as end:
            there = truth(even) > 0.5
            wrong = [
                float(np.mean((Surrogate(*pair).mean(even) > 0.0) != there) / there.mean())
                for pair in ((used.points, used.works), (points[: len(used.works)], works[: len(used.works)]))
            ]
            found.append((end.value.trials, end.value.settled, end.value.doubt, *wrong))
    trials, settled, said, wrong, beside = (np.array(column) for column in zip(*found, strict=True))
    row(
        f"soft, 2-D, {SOFT} truths", f"{np.median(trials):.0f} trials, {settled.sum()} settled",
        f"said {np.median(said):.3f} (worst {said.max():.3f}), error {np.median(wrong):.3f} (worst {wrong.max():.3f})",
        f"of those settled: error at most {wrong[settled].max(initial=0.0):.3f}; Sobol {np.median(beside):.3f}",
    )  # fmt: skip
    assert 0.6 < np.median(wrong / said) < 1.6
    assert np.mean(wrong < 2.0 * said) >= 0.9


def planes(rng, dimension):
    """Fails beyond any of 3 d planes. The true smallest disturbance is the nearest plane's distance."""
    normals = rng.standard_normal((3 * dimension, dimension))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    away = rng.uniform(0.35, 0.9, 3 * dimension)
    return (lambda x: ~np.any(x @ normals.T > away, axis=1)), away.min()


def dent(rng, dimension, slope=2.0):
    """Fails in a cone of half angle 27 degrees whose tip is 0.4 away."""
    axis = rng.standard_normal(dimension)
    axis /= np.linalg.norm(axis)

    def works(x):
        along = x @ axis
        across = np.sqrt(np.maximum(np.sum(x**2, axis=1) - along**2, 0.0))
        return ~(along > 0.4 + slope * across)

    return works, 0.4


def wide_dent(rng, dimension):
    """Fails in a cone of half angle 45 degrees whose tip is 0.4 away."""
    return dent(rng, dimension, slope=1.0)


def broken(kind, dimension, seed, degrees=None):
    """Size found over the smallest, trials, and the first trial of all that failed within 10 % of the smallest."""
    rng = np.random.default_rng([SEED, seed, dimension])
    truth, least = kind(rng, dimension) if degrees is None else kind(rng, dimension, 1.0 / np.tan(np.radians(degrees)))
    seen = sobol(dimension, seed)[: LOOKS[dimension]]
    tried = [seen]
    search = breaking_point.search(Looked(seen, truth(seen)), np.zeros(dimension), breaking_point.BUDGET[dimension])
    try:
        batch = next(search)
        while True:
            tried.append(batch.points)
            batch = search.send(Looked(batch.points, truth(batch.points)))
    except StopIteration as end:
        points = np.concatenate(tried)
        there = np.flatnonzero(~truth(points) & (np.linalg.norm(points, axis=1) <= 1.1 * least))
        found = np.linalg.norm(end.value.points, axis=1)
        size = found[0] / least if len(found) else np.inf
        return size, end.value.trials, there[0] + 1 if len(there) else np.inf


def told(name, dimension, found):
    """A row of the table. How many of the truths were met, and met within 10 %."""
    sizes, spent, first = (np.array(column) for column in zip(*found, strict=True))
    met, near = int(np.sum(np.isfinite(sizes))), int(np.sum(sizes <= 1.1))
    row(
        f"{name}, {dimension}-D", f"{near} of {len(sizes)} within 10 %, {met} met",
        f"worst of those {sizes[np.isfinite(sizes)].max():.2f}, {np.median(spent):.0f} trials after {LOOKS[dimension]}",
        f"met after {np.median(first):.0f} in all (median), within 600 in {np.sum(first <= 600)}, "
        f"within 1024 in {np.sum(first <= 1024)}; at most {max(spent)}",
    )  # fmt: skip
    return met, near


BROKEN = range(300, 360)
"""Truths: their seeds."""


@pytest.mark.parametrize("kind", [planes, dent, wide_dent])
@pytest.mark.parametrize("dimension", [2, 3, 4, 5, 6])
def test_a_breaking_point_is_within_a_tenth_of_the_smallest_in_fourteen_of_fifteen(kind, dimension):
    met, near = told(kind.__name__, dimension, [broken(kind, dimension, seed) for seed in BROKEN])
    if kind is dent and dimension > 4:  # fails in 0.2 and 0.07 % of all directions: that one is met is luck
        chance = covered(ways(dimension, breaking_point.BUDGET[dimension] - 64), axes(dimension, 30_000, 1)).mean()
        assert met >= len(BROKEN) * chance - 2.0 * np.sqrt(len(BROKEN) * chance * (1.0 - chance))
        assert near >= 0.9 * met
    else:
        assert near >= 14 / 15 * len(BROKEN)


@pytest.mark.parametrize("degrees", [30, 33, 36])
def test_how_wide_a_dent_in_six_ranges_is_found(degrees):
    """13 of 15 are found from a half angle of 36 degrees on."""
    _, near = told(f"dent, {degrees} degrees", 6, [broken(dent, 6, seed, degrees) for seed in BROKEN])
    assert near >= 13 / 15 * len(BROKEN) or degrees < 36


def axes(dimension, count, seed):
    """(count, d) directions drawn evenly."""
    drawn = np.random.default_rng([SEED, seed]).standard_normal((count, dimension))
    return drawn / np.linalg.norm(drawn, axis=1)[:, None]


def ways(dimension, count):
    return np.array(list(islice(breaking_point.spread(np.zeros(dimension)), count)))


def fails_up_to(directions, slope=2.0, tip=0.4):
    """Cosine of the angle t to its axis up to which a dent is met at a ray's end R: cos t - slope sin t = tip / R."""
    ends = breaking_point.reach(np.zeros(directions.shape[1]), directions)
    return np.cos(np.arccos(tip / ends / np.hypot(1.0, slope)) - np.arctan(slope))


def covered(directions, about):
    """(m,) which dents about (m, d) axes any of the rays meets at its end."""
    angles = fails_up_to(directions)
    return np.concatenate([np.any(part @ directions.T > angles, axis=1) for part in np.array_split(about, 20)])


def known_best(directions, about, count):
    """Of directions the `count` that meet most dents about axes, each the best beside those before."""
    angles = fails_up_to(directions)[:, None]
    meets = [np.flatnonzero(m) for part in np.array_split(np.arange(len(directions)), 40)
             for m in directions[part] @ about.T > angles[part]]  # fmt: skip
    free, picked = np.ones(len(about), dtype=bool), []
    heap = [(-len(m), i) for i, m in enumerate(meets)]
    heapify(heap)
    while len(picked) < count:
        i = heappop(heap)[1]
        gain = int(np.sum(free[meets[i]]))
        if heap and gain < -heap[0][0]:
            heappush(heap, (-gain, i))
            continue
        free[meets[i]] = False
        picked.append(i)
    return directions[picked]


@pytest.mark.parametrize("dimension", [5, 6])
def test_ways_meet_almost_as_many_narrow_dents_as_ways_chosen_for_them(dimension):
    """Chosen greedily for the very dent, by axes that are not those that judge."""
    about, count = axes(dimension, 40_000, 2), 1024
    best = known_best(axes(dimension, 12_000, 3), axes(dimension, 200_000, 4), count)
    designs = best, ways(dimension, count), breaking_point.directions(dimension)[:count]
    chosen, ours, even = (covered(design, about).mean() for design in designs)
    row(f"{count} ways, {dimension}-D", f"meet {ours:.3f}, Sobol {even:.3f}", f"chosen for the dent {chosen:.3f}")
    assert 1.0 - ours < 0.8 * (1.0 - even)
    assert ours > 0.95 * chosen


RANKED = {
    "two act only together": (lambda x: x[:, 1] * x[:, 2] > 0.0, {1, 2}),
    "one strong, two weak": (lambda x: 2.0 * x[:, 0] + 0.8 * x[:, 1] + 0.8 * x[:, 2] < 0.5, {0, 1, 2}),
    "graded": (lambda x: x[:, 0] + 0.6 * x[:, 1] + 0.4 * x[:, 2] < 0.3, {0, 1, 2}),
}


@pytest.mark.parametrize("name", RANKED)
def test_the_quantities_that_matter_rank_before_the_one_that_does_not(name):
    """Four quantities, of which the others do nothing; 128, 256 and 512 even trials."""
    truth, right = RANKED[name]
    for trials in (128, 256, 512):
        hits = 0
        for seed in range(10):
            points = sobol(4, seed)[:trials]
            found = sensitivity.indices(Surrogate(points, truth(points)), 4)
            hits += set(np.argsort(-found)[: len(right)].tolist()) == right
        row(f"{name}, {trials} trials", f"{hits} of 10 seeds right")
        assert hits >= 8 or trials < 512
