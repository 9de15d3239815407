"""Worlds with second parts, in millimetres, drawn with manifold3d: gears, a latch. And connectors without."""

from itertools import pairwise

import manifold3d
import numpy as np

from tests.part_meshes import FILE, box, export, keyed, rod, write

TEETH, MODULE = 12, 2.0
GEAR = (
    FILE
    + """
[[second]]
name = "gear"
joint = "hinge"
mesh = "second.stl"
units = "mm"
anchor = [0.0245, 0.0, 0.0]
damping = 1e-4
friction = 2e-3
goal = [-0.35, 0.35]
"""
)
LATCH = (
    FILE
    + """
[[second]]
name = "catch"
joint = "slide"
mesh = "second.stl"
units = "mm"
axis = [1, 0, 0]
range = [-0.0001, 0.004]
stiffness = 1000.0
rest = -0.0005
damping = 2.0
mass = 0.02
goal = [-0.0005, 0.0003]
"""
)
BAYONET = (
    FILE
    + """
[task]
turns = [{ lift = "0.3mm", turn = "-18deg" }, { lift = "8mm", turn = "-24deg" }]
[task.demonstration]
tilt = "2deg"
"""
)


def gear(height, bore=0.0, turned=0.0, sides=48):
    """A spur gear around z with straight flanks, its teeth 3 mm wide at the root and 1.6 mm at the tip."""
    pitch = 0.5 * TEETH * MODULE
    whole = rod(pitch - 2.2, 0.0, height, sides)
    tooth = manifold3d.CrossSection(
        [[(pitch - 3.0, -1.5), (pitch + 2.0, -0.8), (pitch + 2.0, 0.8), (pitch - 3.0, 1.5)]]
    )
    for k in range(TEETH):
        angle = 360.0 * (k + turned) / TEETH
        whole = whole + manifold3d.Manifold.extrude(tooth, height).rotate([0.0, 0.0, angle])
    return whole - rod(bore, -1.0, height + 1.0, sides, outside=True) if bore else whole


def gears():
    """A gear with a bore of 8.4 mm, a shaft of 8 mm on a plate, and a second gear 24.5 mm beside it, meshing."""
    plate = box((-16.0, -16.0, -8.0), (42.0, 16.0, 0.0))  # the gear lies on it when done, or nothing stops the push
    return gear(6.0, 4.2), plate + rod(4.0, -1.0, 10.0, 48), gear(6.0, 0.0, 0.5).translate([24.5, 0.0, 0.0])


def latch():
    """A block of 12 x 10 mm with a groove, its pocket, and a catch with slopes of 45 degrees that snaps into it."""
    groove = box((5.0, -6.0, 5.0), (7.0, 6.0, 10.0))
    foot = [(-6.0, 2.0), (-6.0, 20.0), (6.0, 20.0), (6.0, 2.0), (4.0, 0.0), (-4.0, 0.0)]
    plug = manifold3d.Manifold.extrude(manifold3d.CrossSection([foot[::-1]]), 10.0)
    plug = plug.rotate([90.0, 0.0, 0.0]).translate([0.0, 5.0, 0.0])
    socket = box((-12.0, -10.0, -5.0), (18.0, 10.0, 14.0)) - box((-6.2, -5.2, 0.0), (6.2, 5.2, 15.0))
    nose = manifold3d.CrossSection([[(5.0, 7.0), (6.0, 6.0), (12.0, 6.0), (12.0, 9.0), (6.0, 9.0), (5.0, 8.0)]])
    catch = manifold3d.Manifold.extrude(nose, 6.0).rotate([90.0, 0.0, 0.0]).translate([0.0, 3.0, 0.0])
    return plug - groove, socket - box((5.0, -3.3, 5.5), (18.5, 3.3, 9.5)), catch


def connector():
    """A round shaft of 12 mm with a key and a chamfer, 12 mm deep."""
    tip = manifold3d.Manifold.cylinder(1.0, 5.0, 6.0, circular_segments=48).translate([0.0, 0.0, -13.0])
    block = box((-16.0, -16.0, -18.0), (16.0, 16.0, 0.0))
    return keyed(6.0, 3.0, 2.0, -12.0, 8.0) + tip, block - keyed(6.2, 3.4, 2.2, -13.2, 1.0, outside=True)


def usb():
    """A shell of 12 x 4.5 mm and 0.5 mm walls over a tongue in a pocket, 8 mm deep."""
    shell = box((-6.0, -2.25, 0.0), (6.0, 2.25, 18.0)) - box((-5.5, -1.75, -1.0), (5.5, 1.75, 10.0))
    pocket = box((-12.0, -8.0, -4.0), (12.0, 8.0, 8.0)) - box((-6.2, -2.45, 0.0), (6.2, 2.45, 9.0))
    return shell, pocket + box((-5.2, -1.45, -1.0), (5.2, 1.45, 6.5))


def pins(grown=0.0, inner=8.0):
    """Two pins of 4 mm along x, their middles 6 mm below the mouth, out to 15 mm, grown all around."""
    pin = manifold3d.Manifold.cylinder(15.0 - inner + grown, 2.0 + grown, circular_segments=32)
    pin = pin.rotate([0.0, 90.0, 0.0]).translate([inner, 0.0, -6.0])
    return pin + pin.rotate([0.0, 0.0, 180.0])


def bayonet():
    """A cap of 24 mm with two pins: down a groove at 80 degrees from the level, then along a lock of 18 degrees.

    The groove's mouth is wider by 1.5 mm on either side, over 2 mm, as those of real ones are.
    """
    way = [[(0.0, 0.0), (0.3, -18.0), (8.0, -24.0), (12.0, -24.0)]]
    way += [[(4.0, -20.9), (6.0, -22.5 + wider), (12.0, -22.5 + wider)] for wider in (-6.4, 6.4)]
    grooves, grown = [], pins(0.3, inner=11.0)
    for (low, a), (high, b) in (piece for each in way for piece in pairwise(each)):
        ends = np.linspace((low, a), (high, b), 13)
        there = [[side.translate([0.0, 0.0, z]).rotate([0.0, 0.0, t]) for side in grown.decompose()] for z, t in ends]
        grooves += [(one + two).hull() for now, then in pairwise(there) for one, two in zip(now, then, strict=True)]
    bore = rod(12.3, -8.3, 1.0, 48, outside=True)
    socket = box((-20.0, -20.0, -14.0), (20.0, 20.0, 0.0)) - bore
    for groove in grooves:
        socket = socket - groove
    return rod(12.0, -8.0, 10.0, 48) + pins(), socket


def made(name, folder):
    """The fixture file of a world by name."""
    text = {"gear": GEAR, "latch": LATCH, "bayonet": BAYONET}.get(name, FILE)
    drawn = {"gear": gears, "latch": latch, "connector": connector, "usb": usb, "bayonet": bayonet}
    plug, socket, *second = drawn[name]()
    path = write(folder / name, plug, socket, text)
    for solid in second:
        export(solid, path.parent / "second.stl")
    return path


WORLDS = ("gear", "latch", "connector", "usb", "bayonet")
