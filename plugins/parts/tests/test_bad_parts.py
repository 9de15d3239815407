"""Meshes and pairs that cannot be used, each a sentence, and what is repaired with a note. All drawn here."""

import numpy as np
import pytest
import trimesh
from skillframe_parts.declared import read_fixture
from skillframe_parts.load import load
from skillframe_parts.solid import LARGEST_FILE, arrays_of, read_part

from skillframe.errors import InputError
from tests.part_meshes import FILE, box, export, hole, keyed, rod, round_pair, write

CUBE = box((0, 0, 0), (10, 10, 10))


def saved(folder, vertices, faces, name="part.stl"):
    path = folder / name
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path


def refused(call, *words):
    with pytest.raises(InputError) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text and all(word in text for word in words), text


def test_a_closed_mesh_is_a_solid_of_its_volume_in_metres(tmp_path):
    export(CUBE, tmp_path / "part.stl")
    part = read_part(tmp_path / "part.stl", "mm")
    assert part.solid.volume() == pytest.approx(1e-6, rel=1e-6)  # single precision in the file
    assert part.notes == () and part.size == pytest.approx(0.01)


@pytest.mark.parametrize("ending", ["obj", "ply", "off", "glb"])
def test_formats_say_the_same(tmp_path, ending):
    export(CUBE, tmp_path / f"part.{ending}")
    assert read_part(tmp_path / f"part.{ending}", "mm").solid.volume() == pytest.approx(1e-6, rel=1e-6)


def test_an_open_mesh_is_refused_with_the_place(tmp_path):
    vertices, faces = arrays_of(CUBE)
    path = saved(tmp_path, vertices, faces[1:])
    refused(lambda: read_part(path, "mm"), "3 open edges", "close it")


def test_a_mesh_that_is_inside_out_is_turned_and_said(tmp_path):
    vertices, faces = arrays_of(CUBE)
    part = read_part(saved(tmp_path, vertices, faces[:, ::-1]), "mm")
    assert part.solid.volume() == pytest.approx(1e-6, rel=1e-6)
    assert "inside out (volume -1 cm3)" in part.notes[0]


def test_a_triangle_that_is_turned_against_the_others_is_turned_and_said(tmp_path):
    vertices, faces = arrays_of(CUBE)
    faces[0] = faces[0, ::-1]
    part = read_part(saved(tmp_path, vertices, faces), "mm")
    assert part.solid.volume() == pytest.approx(1e-6, rel=1e-6)
    assert part.notes == ("part.stl: triangles turned as their neighbours: 1",)


def test_bodies_that_overlap_are_united_and_said(tmp_path):
    bodies = [trimesh.Trimesh(*arrays_of(CUBE.translate([5.3 * k, 0, 0])), process=False) for k in range(42)]
    trimesh.util.concatenate(bodies).export(tmp_path / "part.stl")
    part = read_part(tmp_path / "part.stl", "mm")
    assert part.solid.volume() == pytest.approx(227.3e-3 * 1e-4, rel=1e-6)
    assert "42 bodies" in part.notes[0] and "46 % of their volume" in part.notes[0]


def test_a_body_inside_another_that_is_turned_inwards_is_a_cavity(tmp_path):
    hollow = CUBE - box((2, 2, 2), (8, 8, 8))
    export(hollow, tmp_path / "part.stl")
    assert read_part(tmp_path / "part.stl", "mm").solid.volume() == pytest.approx(784e-9, rel=1e-6)


def test_a_size_that_no_part_has_is_refused_with_the_unit_that_was_meant(tmp_path):
    export(CUBE, tmp_path / "part.stl")
    refused(lambda: read_part(tmp_path / "part.stl", "m"), "is 10 m long in m", 'units = "mm"')
    refused(lambda: read_part(tmp_path / "part.stl", "um"), "is 1e-05 m long in um", 'units = "mm"')


def test_an_empty_file_is_refused(tmp_path):
    (tmp_path / "part.obj").write_text("")
    refused(lambda: read_part(tmp_path / "part.obj", "mm"), "part.obj")
    (tmp_path / "part.off").write_text("OFF\n0 0 0\n")
    refused(lambda: read_part(tmp_path / "part.off", "mm"), "part.off")


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    vertices, faces = arrays_of(CUBE)
    vertices[3, 1] = np.nan
    refused(lambda: read_part(saved(tmp_path, vertices, faces), "mm"), "not finite")


@pytest.mark.parametrize("name", ["part.stl", "part.ply", "part.glb", "part.off"])
def test_noise_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(bytes(range(1, 256)) * 3)
    refused(lambda: read_part(tmp_path / name, "mm"), name)


@pytest.mark.parametrize("name", ["part.3mf", "part.dae"])
def test_formats_that_are_not_read_are_said(tmp_path, name):
    (tmp_path / name).write_text("x")
    refused(lambda: read_part(tmp_path / name, "mm"), "export it as STL")


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "part.stl").open("wb") as file:
        file.truncate(LARGEST_FILE + 1)
    refused(lambda: read_part(tmp_path / "part.stl", "mm"), "larger than 100 MB")


def test_too_many_triangles_are_thinned_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe_parts.solid.MOST_TRIANGLES", 500)
    export(CUBE.refine(10), tmp_path / "part.stl")
    part = read_part(tmp_path / "part.stl", "mm")
    assert part.solid.num_tri() < 500 and part.solid.volume() == pytest.approx(1e-6, rel=1e-5)
    assert "1,200 triangles" in part.notes[0]


def pair(folder, plug, socket, text=FILE):
    return lambda: load(write(folder, plug, socket, text))


def test_parts_that_overlap_are_refused_with_depth_and_place(tmp_path):
    plug, socket = round_pair()
    refused(pair(tmp_path, plug.translate([0.7, 0, 0]), socket), "overlap by", "mm at (", "press fits")


def test_parts_far_from_each_other_are_refused(tmp_path):
    plug, socket = round_pair()
    refused(pair(tmp_path, plug.translate([1400, 0, 0]), socket), "lies 1.38e+03 mm from", "one assembly")


def test_parts_of_other_scales_are_refused(tmp_path):
    plug, socket = round_pair()
    text = FILE.replace('units = "mm"', 'units = "cm"', 1)
    refused(pair(tmp_path, plug.scale([0.2] * 3), socket, text), "75 times as large")


def test_a_part_that_cannot_come_out_is_refused_with_what_stands_in_the_way(tmp_path):
    plug, socket = round_pair()
    bar = box((-15, -2, 10), (15, 2, 12)) + box((-15, -2, -1), (-13, 2, 12))
    refused(pair(tmp_path, plug, socket + bar), "cannot leave socket.stl along (0, 0, 1)", "of lift")
    text = FILE + '[task]\naxis = "auto"\n'
    refused(pair(tmp_path / "auto", plug, socket + bar, text), "more than one straight motion")


def test_a_hole_of_fewer_sides_than_its_play_needs_is_refused(tmp_path):
    plug, socket = rod(5.0, -12.0, 8.0, 16, outside=True), hole(5.05, 12.0, 16)
    refused(pair(tmp_path, plug, socket), "16 sides a turn", "export it finer")


def test_meshes_that_are_the_parts_have_no_circle_to_be_held_against(tmp_path):
    plug, socket = rod(5.0, -12.0, 8.0, 16, outside=True), hole(5.05, 12.0, 16)
    text = FILE.replace("[contact]\n", "[contact]\nas_meshed = true\n")
    assert "as_meshed" in text
    found = pair(tmp_path, plug, socket, text)()
    # flats of both are 0.05 mm cos(pi / 16) apart, and contact is as exact as the play asks
    assert found.fit.clearance == pytest.approx(5e-5 * np.cos(np.pi / 16), rel=0.05)
    assert found.contact_error < 0.25 * found.fit.clearance


def test_an_overlap_is_let_pass_as_far_as_the_file_says(tmp_path):
    plug, socket = round_pair()
    plug = plug.translate([0.45, 0, 0])  # more than 0.01 and less than 0.1 mm of both in the mean
    refused(pair(tmp_path, plug, socket), "overlap by", "give contact.overlap")
    text = FILE.replace("[contact]\n", '[contact]\noverlap = "0.1mm"\n')
    refused(pair(tmp_path / "let", plug, socket, text), "the play along the way is 0 mm")


def test_a_thin_wall_is_refused(tmp_path):
    plug, socket = round_pair()
    slit = box((4, -3, -17), (14, 3, 0)) - box((4, -0.05, -17), (14, 0.05, 0))  # open to the hole
    refused(pair(tmp_path, plug, socket - slit), "socket.stl", "thinner than 0.2 mm")


def test_a_thin_wall_that_the_other_part_cannot_come_to_is_let_pass(tmp_path):
    plug, socket = round_pair()
    slit = box((5.9, -3, -17), (14, 3, 0)) - box((5.9, -0.05, -17), (14, 0.05, 0))  # behind 0.7 mm
    assert pair(tmp_path, plug, socket - slit)().fit.depth == pytest.approx(0.012)


def test_a_thin_wall_counts_where_the_other_part_is_not_at_that_height(tmp_path):
    """A plate on a foot that stands beside the hole's middle: at half depth there is nothing of the plug."""
    plug = (
        box((-4, -4, -1), (4, 4, 10))
        + box((-1, -1, -12), (1, 1, -7))
        + box((3, 3, -12), (4, 4, 0))
        - box((2, 2, -7), (5, 5, -5))
    )
    socket = box((-15, -15, -17), (15, 15, 0)) - box((-5, -5, -13), (5, 5, 1))
    slit = box((6, -3, -17), (14, 3, 0)) - box((6, -0.05, -17), (14, 0.05, 0))
    refused(pair(tmp_path, plug, socket - slit), "socket.stl", "thinner than 0.2 mm")


def test_parts_without_play_are_refused(tmp_path):
    block = box((-15, -15, -17), (15, 15, 0)) - box((-5, -5, -12), (5, 5, 1))
    refused(pair(tmp_path, box((-5, -5, -12), (5, 5, 8)), block), "the play along the way is 0 mm")


@pytest.mark.slow
def test_a_part_that_pieces_do_not_hold_is_refused_without_a_compiler_with_how_many_it_takes(tmp_path, monkeypatch):
    for module in ("checks", "load"):
        monkeypatch.setattr(f"skillframe_parts.{module}.MOST_PIECES", 5)
    monkeypatch.setattr("skillframe_parts.load.available", lambda: False)
    monkeypatch.setattr("skillframe_parts.load._LOADED", {})  # the same files were taken by other tests
    words = ("socket.stl: takes 13 convex pieces", "0.093 mm, a quarter of the clearance", "5 are the most")
    refused(pair(tmp_path, *round_pair()), *words)


@pytest.mark.slow
def test_a_heavy_part_is_asked_about(tmp_path):
    plug, socket = round_pair()
    loaded = load(write(tmp_path, plug.scale([9] * 3), socket.scale([9] * 3), FILE))
    assert any("a hollow part? give mass" in note for note in loaded.notes)


def test_keys_are_read_strictly(tmp_path):
    plug, socket = round_pair()
    for text, words in {
        FILE.replace("friction", "fricton"): ("did you mean 'friction'", "contact"),
        FILE.replace('units = "mm"', 'units = "parsec"', 1): ("parsec", "fixture.units"),
        FILE.replace('units = "mm"\n', "", 1): ("fixture.units", "does not say", 'units = "mm"'),
        FILE.replace("socket.stl", "sokket.stl"): ("no such file: 'sokket.stl'",),
        FILE.replace("0.2", "-1"): ("contact.friction", "beyond 0 to 5"),
        FILE + '[task]\naxis = "up"\n': ("task.axis",),
        FILE + "[task]\naxis = [0, 0, 0]\n": ("task.axis", "is zero"),
        FILE.replace("[contact]", "mass = 1\ndensity = 2\n[contact]"): ("mass and density",),
    }.items():
        path = write(tmp_path, plug, socket, text)
        refused(lambda path=path: read_fixture(path), *words)


def test_a_mesh_outside_the_files_folder_is_refused(tmp_path):
    plug, socket = round_pair()
    path = write(tmp_path / "in", plug, socket, FILE.replace("plug.stl", "../plug.stl"))
    export(plug, tmp_path / "plug.stl")
    refused(lambda: read_fixture(path), "lies outside", "into one folder")


@pytest.mark.slow
def test_a_key_stays_a_key(tmp_path):
    """Two bodies that share a part of their volume, as CAD exports them, are one part of the volume of both."""
    plug = keyed(5.0, 3.0, 1.5, -10.0, 8.0)
    export(plug, tmp_path / "one.stl")
    bodies = [rod(5.0, -10.0, 8.0, 48), box((0, -1.5, -10), (6.5, 1.5, 8))]
    trimesh.util.concatenate([trimesh.Trimesh(*arrays_of(b), process=False) for b in bodies]).export(
        tmp_path / "two.stl"
    )
    one, two = (read_part(tmp_path / name, "mm").solid.volume() for name in ("one.stl", "two.stl"))
    assert one == pytest.approx(two, rel=1e-6)
