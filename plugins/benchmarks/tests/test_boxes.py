"""Worlds of plugs and ports that are boxes of SDF files, drawn here as the published ones are."""

import numpy as np
import pytest
from skillframe_benchmarks.boxes import write
from skillframe_parts.load import load
from skillframe_parts.solid import arrays_of

from skillframe.cli.main import run
from skillframe.errors import InputError

SHAPE = "<collision name='c'><pose>{pose}</pose><geometry>{shape}</geometry></collision>"
MODEL = """\
<?xml version="1.0" ?>
<sdf version="1.9"><model name="m">
<link name="{link}"><inertial auto="true"><mass>0.04</mass></inertial>{shapes}
<sensor name="s"><contact><collision>c</collision></contact></sensor></link>
<link name="{frame}"><pose>{pose}</pose></link>
</model></sdf>
"""


def box(pose, *size):
    return SHAPE.format(pose=pose, shape=f"<box><size>{' '.join(map(str, size))}</size></box>")


def model(folder, name, link, frame, pose, *shapes):
    place = folder / "aic_assets" / "models" / name
    place.mkdir(parents=True)
    (place / "model.sdf").write_text(MODEL.format(link=link, frame=frame, pose=pose, shapes="".join(shapes)))
    return place / "model.sdf"


def walls(inner, outer, deep, thick):
    """A square cup along +y of its link, open towards +y, its floor's upper side at y = 0, turned piece by piece."""
    side, mid = 0.5 * (inner + outer) / 2.0, 0.5 * deep
    wall = (outer - inner) / 2.0
    return [
        box(f"{x} {mid} {z} 0 0 0", *((wall, deep, outer) if x else (inner, deep, wall)))
        for x, z in ((side, 0), (-side, 0), (0, side), (0, -side))
    ] + [box(f"0 {-0.5 * thick} 0 0 0 1.570796", thick, outer, outer)]


def published(folder, sunk=0.0):
    """A bar of 8 mm in a port of 8.4 mm, 15 mm deep. The tip looks along +x of the plug, the port's frame into it."""
    shapes = [box("-0.01 0 0 1.570796 0 0", 0.02, 0.008, 0.008)]
    model(folder, "SC Plug", "sc_plug_link", "sc_tip_link", f"{-sunk} 0 0 0 1.5707963 0", *shapes)
    port = walls(0.0084, 0.016, 0.015, 0.004)
    return model(folder, "SC Port", "sc_port_link", "sc_port_base_link", "0 0 0 1.5707963 0 0", *port)


def test_boxes_become_a_world_in_which_the_tip_is_home_in_the_ports_frame(tmp_path):
    published(tmp_path)
    found = write(tmp_path, "sc", tmp_path / "out")
    loaded = load(found.path)
    # angles in the files have seven digits, lengths in the meshes nine
    assert found.height == 0.0 and loaded.fit.depth == pytest.approx(0.015, abs=1e-8)
    assert loaded.fit.clearance == pytest.approx(0.0002, abs=1e-7) and loaded.mass == 0.04
    assert np.allclose(loaded.fit.plug.volume(), 0.02 * 0.008**2, rtol=1e-6) and loaded.backend == "pieces"
    assert loaded.fit.socket.volume() == pytest.approx((0.016**2 - 0.0084**2) * 0.015 + 0.016**2 * 0.004, rel=1e-6)


def test_faces_that_meet_but_for_the_digits_of_an_angle_are_one_face(tmp_path):
    """The floor's angle has seven digits: its corners lie 3 nm beside the walls', which would be cut apart there."""
    published(tmp_path)
    vertices, _ = arrays_of(load(write(tmp_path, "sc", tmp_path / "out").path).fit.socket)
    assert len(np.unique(np.round(vertices[:, 2], 12))) == 3  # below the floor, above it, and the mouth


def test_a_plug_whose_boxes_reach_into_the_port_is_raised_until_they_touch(tmp_path):
    """8 mm square, 0.1 mm deep in the floor: raised by 0.09 mm it is 0.01 mm, and that is let pass."""
    published(tmp_path, sunk=1e-4)
    assert write(tmp_path, "sc", tmp_path / "out").height == pytest.approx(9e-5, abs=1.1e-5)


def test_a_plug_that_is_published_above_the_ports_bottom_is_lowered_to_it(tmp_path):
    published(tmp_path, sunk=-1.5e-4)
    assert write(tmp_path, "sc", tmp_path / "out").height == pytest.approx(-1.5e-4, abs=1.1e-5)  # one step


@pytest.mark.slow
def test_plates_that_are_too_thin_for_contact_grow_inwards(tmp_path):
    """A bar of 8 mm of four plates of 0.1 mm, closed at both ends: its outside stays, its plates are 0.202 mm."""
    published(tmp_path)
    plates = [box(f"-0.01 {y} {z} 0 0 0", 0.02, *((1e-4, 0.008) if y else (0.008, 1e-4)))
              for y, z in ((0.00395, 0), (-0.00395, 0), (0, 0.00395), (0, -0.00395))]  # fmt: skip
    ends = [box(f"{x} 0 0 0 0 0", 0.001, 0.008, 0.008) for x in (-0.0005, -0.0195)]
    model(tmp_path / "thin", "SC Plug", "sc_plug_link", "sc_tip_link", "0 0 0 0 1.5707963 0", *plates, *ends)
    thin = tmp_path / "thin" / "aic_assets" / "models" / "SC Plug" / "model.sdf"
    thin.replace(tmp_path / "aic_assets" / "models" / "SC Plug" / "model.sdf")
    plug = load(write(tmp_path, "sc", tmp_path / "out").path).fit.plug
    inner = 0.008 - 2.0 * 2.02e-4
    assert plug.volume() == pytest.approx(0.02 * 0.008**2 - 0.018 * inner**2, rel=1e-6)
    extents = np.ptp(np.reshape(plug.bounding_box(), (2, 3)), axis=0)
    assert extents == pytest.approx([0.008, 0.008, 0.02], abs=2.1e-9)  # places are rounded to 1e-9 m


def test_a_plug_that_reaches_far_into_the_port_is_refused(tmp_path):
    published(tmp_path, sunk=1e-3)
    with pytest.raises(InputError, match=r"overlap even 0\.2 mm above"):
        write(tmp_path, "sc", tmp_path / "out")


def test_cylinders_have_their_radius_and_length_along_z(tmp_path):
    published(tmp_path)
    shape = "<cylinder><radius>0.003</radius><length>0.03</length></cylinder>"
    rod = SHAPE.format(pose="-0.015 0 0 0 1.5707963 0", shape=shape)
    path = tmp_path / "aic_assets" / "models" / "SC Plug" / "model.sdf"
    model(tmp_path / "other", "SC Plug", "sc_plug_link", "sc_tip_link", "0 0 0 0 1.5707963 0", rod)
    path.write_text((tmp_path / "other" / "aic_assets" / "models" / "SC Plug" / "model.sdf").read_text())
    plug = load(write(tmp_path, "sc", tmp_path / "out").path).fit.plug
    area = 0.5 * 64 * np.sin(2.0 * np.pi / 64) * 0.003**2  # 64 corners on the circle
    assert plug.volume() == pytest.approx(0.03 * area, rel=1e-6)


def test_the_command_says_what_it_found_and_what_is_refused(tmp_path, capsys):
    published(tmp_path)
    assert run(["benchmark", "insertion", str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    out, said = capsys.readouterr()
    assert "plug.sdf goes 15 mm deep into port.sdf" in out and "0 mm above its published place" in out
    assert "sfp is refused" in said and "holds no SFP Module/model.sdf" in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<sdf", "<<sdf", "line 2"),
        ("sc_port_base_link", "sc_port_bottom", "has no link 'sc_port_base_link'"),
        ("box>", "sphere>", "<sphere> of <geometry> is not read"),
        ("0 0 0 1.5707963 0 0", "0 0 0 1.57 0", "not 6 finite numbers"),
        ("<size>0.0038", "<size>x", "not 3 finite numbers"),
    ],
)
def test_models_that_cannot_be_read_are_a_sentence_and_the_exit_code_2(tmp_path, capsys, old, new, words):
    path = published(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    assert run(["benchmark", "insertion", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    out, said = capsys.readouterr()
    assert out == "" and words in said and said.count("\n") == 2
