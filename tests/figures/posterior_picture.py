"""Draws docs/images/posterior.svg: python -m tests.figures.posterior_picture FILE."""

import sys

import matplotlib as mpl
from skillframe_lmc.explain import STYLE
from skillframe_lmc.phase import read_phase
from skillframe_lmc.pictures import draw_directions

from tests.figures.teaching import learned, taught


def draw(where):
    """Two demonstrations of a valley and three of a hump, by a person with 8 degrees of aim noise."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    with mpl.rc_context(STYLE):
        figure, canvases = plt.subplots(1, 2, figsize=(9.0, 4.6), layout="constrained")
        for canvas, (world, count) in zip(canvases, (("valley", 2), ("hump", 3)), strict=True):
            ((shown, *_), _) = taught(world, {}, 8.0, pairs=1, each=count)
            draw_directions(canvas, read_phase(learned(shown)).translation, "base")
            canvas.get_legend().remove()
            canvas.text(0.02, 0.98, world, transform=canvas.transAxes, va="top", fontweight="bold")
        figure.savefig(where, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    draw(sys.argv[1])
