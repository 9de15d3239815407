"""Meshes as they come, through `worlds new` and `worlds`: each ends in one sentence, or is taken with a note."""

import os

import numpy as np
import pytest
from skillframe_parts import load
from skillframe_parts.solid import arrays_of

from skillframe.cli.main import run
from skillframe.errors import SkillframeWarning
from tests.bad_meshes import (
    ascii_stl,
    binary_stl,
    glb,
    joined,
    obj,
    off,
    pin,
    plug,
    ply,
    quads,
    scene,
)
from tests.part_meshes import FILE, box, export, in_metres, rod, round_pair

pytestmark = pytest.mark.timeout(60)  # what hangs is a fault, too
V, F = plug()
SOCKET = binary_stl(*arrays_of(round_pair()[1]))
P, Q, T = pin(), quads(), [t for q in quads() for t in ([q[0], q[1], q[2]], [q[0], q[2], q[3]])]
SPLIT = [*[t for t in T if t != [4, 5, 6]], [4, 8, 6], [8, 5, 6]]
WORDS = ascii_stl(V, F)
SHEET = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]], dtype=float)
FLAT = [[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]]
DOCUMENT, POINTS = scene(P * 1e-3, T)
DRACO = {"extensionsRequired": ["KHR_draco_mesh_compression"]}
APART = {"buffers": [{"uri": "../../../etc/passwd", "byteLength": 10}]}
DOTS = {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}]}

FILES = {
    # name of the file: its content, and words of the sentence
    "empty.stl": (b"", "is empty: it holds nothing"),
    "blank.obj": ("\n \n", "is empty: it holds nothing"),
    "cut.stl": (binary_stl(V, F)[:-333], "says that it holds 44 triangles and has the bytes of 37.34"),
    "bomb.stl": (binary_stl(V, F, 4_000_000_000), "says that it holds 4,000,000,000 triangles"),
    "more.stl": (binary_stl(V, F, 5), "says that it holds 5 triangles and has the bytes of 44"),
    "none.stl": (binary_stl(V, F[:0]), "holds no triangle"),
    "short.stl": (b"x" * 50, "cut off: it has 50 bytes"),
    "cut_words.stl": (WORDS[: len(WORDS) // 2], "cut off: 22 facets begin and 21 end"),
    "half_a_facet.stl": (WORDS.replace("endfacet\n", "", 1), "cut off: 44 facets begin and 43 end"),
    "no_end.stl": (WORDS.replace("endsolid part", ""), "44 facets begin and 44 end, without a last line"),
    "nan.stl": (WORDS.replace("vertex 5 ", "vertex nan ", 1), "1 of 132 vertices that are not finite"),
    "inf.stl": (WORDS.replace("-12", "inf", 1), "not finite"),
    "word.stl": (WORDS.replace("-12", "abc", 1), "has 'abc' in place of a number"),
    "no_facet.stl": ("solid part\nendsolid part\n", "holds no triangle"),
    "one.stl": (binary_stl(V, F[:1]), "no volume"),
    "sheet.stl": (binary_stl(SHEET, FLAT[:2]), "4 open edges"),
    "lidless.stl": (binary_stl(P, T[2:]), "4 open edges"),
    "half_a_skin.stl": (binary_stl(V, F[::2]), "open edges"),
    "flat.stl": (binary_stl(SHEET, FLAT), "no volume"),
    "fin.stl": (binary_stl(np.r_[P, [[0, 0, 20.0]]], [*T, [4, 6, 8]]), "open edges"),
    "zeros.stl": (binary_stl(np.zeros((3, 3)), [[0, 1, 2]] * 1000), "is 0 m long"),
    "tiny.stl": (binary_stl(V * 1e-4, F), "a part is 1 mm to 2 m"),
    "metres.stl": (binary_stl(V * 1e-3, F), 'say units = "m"'),
    "huge.stl": (binary_stl(V * 1e6, F), "a part is 1 mm to 2 m"),
    "overflow.stl": (binary_stl(V * 1e35, F), "a part is 1 mm to 2 m"),
    "far.stl": (binary_stl(V + 1e5, F), "export both from one assembly"),
    "page.stl": ("<!DOCTYPE html><html>404</html>", "web page"),
    "pointer.stl": ("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 9\n", "git lfs pull"),
    "archive.stl": (b"PK\3\4" + bytes(200), "unpack it"),
    "picture.stl": (b"\x89PNG\r\n\x1a\n" + bytes(200), "picture"),
    "drawing.stl": ("ISO-10303-21;\nHEADER;\nENDSEC;\n", "is STEP by its content"),
    "words.stl": (obj(V, F), "rename it to words.obj"),
    "polygons.stl": (ply(V, F), "rename it to polygons.ply"),
    "binary.obj": (binary_stl(V, F), "rename it to binary.stl"),
    "binary.glb": (binary_stl(V, F), "rename it to binary.stl"),
    "part.txt": (WORDS, "is no mesh that is read"),
    "part": (WORDS, "is no mesh that is read"),
    "part.gltf": ("{}", "is no mesh that is read"),
    "part.step": ("ISO-10303-21;", "cut off: it has no END-ISO-10303-21"),
    "points.obj": (obj(V, []), "24 vertices and no face"),
    "lines.obj": (obj(V, []) + "l 1 2\n", "24 vertices and no face"),
    "range.obj": (obj(V, [*F, [1, 2, 998]]), "line 69 has a face of vertex 999, and there are 1 to 24"),
    "zero.obj": (obj(V, F, shift=0), "line 25 has a face of vertex 0"),
    "below.obj": (obj(P, [*T, [-100, -99, -98]]), "a face of vertex -99, and there are 1 to 8"),
    "bomb.obj": (obj(V, [[0, 1, 10**9]]), "a face of vertex 1000000001"),
    "part_of.obj": (obj(V, F).replace("f ", "f 1.5 ", 1), "a face of vertex 1.5"),
    "words.obj": (obj(V, F).replace("v 5", "v five", 1), "line 18 has 'five' in place of a number"),
    "nan.obj": (obj(V, F).replace("v 5", "v nan"), "not finite"),
    "format.ply": (ply(V, F, head="format klingon 1.0"), "'klingon'"),
    "magic.ply": ("plyy\n" + ply(V, F), "its first line is not ply"),
    "points.ply": (ply(V, []), "24 vertices and no face"),
    "no_end.ply": (ply(V, F, end=""), "no end_header"),
    "bomb.ply": (ply(V, F, count=10**12), "1,000,000,000,000 of vertex and 44 of face, and 69 lines follow"),
    "cut.ply": (ply(V, F)[:600], "cut off: its head says"),
    "words_as_bytes.ply": (ply(V, F, head="format binary_little_endian 1.0"), "cannot be read as PLY"),
    "range.ply": (ply(V, [*F, [1, 2, 999]]), "vertices that it does not have"),
    "counts.off": (off(V, F, "9999 9999 0"), "says 9,999 vertices and 9,999 faces, and 68 lines follow"),
    "bomb.off": (off(V, F, "999999999999 999999999999 0"), "cut off"),
    "minus.off": (off(V, F, "-1 -1 0"), "'-1', which is no number of things"),
    "head.off": (off(V, F)[4:], "its first line is not OFF"),
    "only.off": ("OFF\n", "no line of counts"),
    "range.off": (off(V, [*F, [1, 2, 999]]), "outside the range of its vertices"),
    "magic.glb": (glb(DOCUMENT, POINTS, magic=b"glTX"), "does not begin with glTF"),
    "cut.glb": (glb(DOCUMENT, POINTS)[:-100], "cut off: it says 816 bytes and has 716"),
    "bomb.glb": (glb(*scene(P, T, count=10**9)), "cannot be read as GLB"),
    "json.glb": (glb(b"{broken", POINTS), "not described in JSON"),
    "none.glb": (glb({"asset": {"version": "2.0"}}), "holds no mesh"),
    "dots.glb": (glb({**DOCUMENT, **DOTS}, POINTS), "holds no triangle"),
    "draco.glb": (glb({**DOCUMENT, **DRACO}, POINTS), "without compression"),
    "apart.glb": (glb({**DOCUMENT, **APART}), "in another file"),
    "millimetres.glb": (glb(*scene(P, T)), 'say units = "mm"'),
}  # fmt: skip

TAKEN = {
    # name of the file: its content, and words of the note, "" where there is nothing to be said
    "inside_out.stl": (binary_stl(V, F[:, ::-1]), "is inside out"),
    "turned.stl": (binary_stl(V, np.r_[F[:9, ::-1], F[9:]]), "triangles turned as their neighbours: 9"),
    "hole.stl": (binary_stl(V, F[1:]), "closed 1 hole"),
    "corner_on_edge.stl": (binary_stl(np.r_[P, [[0, -3.5, 8]]], SPLIT), "edges split at corners that lie on them: 1"),
    "twice.stl": (binary_stl(V, np.r_[F, F]), "doubled triangles left out: 44"),
    "both_sides.stl": (binary_stl(V, np.r_[F, F[:, ::-1]]), "doubled triangles left out: 44"),
    "PART.STL": (binary_stl(V, F), ""),
    "quads.obj": (obj(P, Q), ""),
    "from_the_end.obj": (obj(P, [[i - 9 for i in face] for face in Q]), ""),
    "two_shells.stl": (binary_stl(*joined((V, F), box((8, 8, 5), (9, 9, 6)))), "2 bodies"),
    "nested.stl": (binary_stl(*joined((V, F), box((-1, -1, -5), (1, 1, 6)))), "2 bodies"),
    "pinched.stl": (binary_stl(*joined(box((-3, -3, -12), (0, 0, 8)), box((0, 0, -12), (3, 3, 8)))), ""),
    "no_area.stl": (binary_stl(V, [*F, [0, 0, 1], [2, 2, 2]]), ""),
    "Stöpsel für 'x' \"✓\".stl": (binary_stl(V, F), ""),
    "metres.glb": (glb(DOCUMENT, POINTS), ""),
    "moves.glb": (glb({**DOCUMENT, "animations": [{"channels": [], "samplers": []}]}, POINTS), "has animations"),
}


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def folder(tmp_path, cache, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.setattr(load, "_LOADED", {})
    write(tmp_path, "socket.stl", SOCKET)
    return tmp_path


def new(place, name, *more, socket="socket.stl", units="mm"):
    given = ["--units", units] if units else []
    return run(
        ["worlds", "new", f"{place}/{name}", f"{place}/{socket}", *given, "--out", f"{place}/fixture.toml", *more]
    )


def write(place, name, content):
    (place / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def sentence(capsys, *words):
    """One line that says where, what, and what to do."""
    out, said = capsys.readouterr()
    assert out == "" and said.startswith("error: ") and said.count("\n") == 1 and ": " in said[7:], said
    assert all(word in said for word in words), said
    return said


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_cannot_be_used_is_one_sentence_and_leaves_nothing(name, folder, capsys):
    content, words = FILES[name]
    write(folder, name, content)
    before = sorted(os.listdir(folder))
    assert new(folder, name) == 2
    assert "; " in sentence(capsys, name, words)
    assert sorted(os.listdir(folder)) == before


@pytest.mark.parametrize("name", TAKEN)
def test_a_file_that_can_be_used_is_taken_with_a_note(name, folder, capsys):
    content, words = TAKEN[name]
    write(folder, name, content)
    assert new(folder, name) == 0
    out, said = capsys.readouterr()
    notes = [line for line in out.splitlines() if line.startswith("note: ")]
    assert said == "" and f"{name} goes 12 mm deep into socket.stl" in out
    assert any(words in note for note in notes) if words else notes == []


def at(place, name):
    """What stands where the held part's mesh is to be, by the name of its fault."""
    path = place / "plug.stl"
    if name == "folder":
        path.mkdir()
    elif name == "pipe":
        os.mkfifo(path)
    elif name != "nothing":
        path.symlink_to({"itself": "plug.stl", "nowhere": "gone.stl", "device": "/dev/zero", "outside": __file__}[name])


THERE = {
    "nothing": "no such file", "folder": "is a folder", "pipe": "is a pipe", "itself": "symbolic links",
    "nowhere": "is a link to 'gone.stl', which is not there", "device": "is a pipe or a device",
    "outside": "lies outside",
}  # fmt: skip


@pytest.mark.parametrize("name", THERE)
def test_what_is_no_file_is_said_before_anything_waits_for_it(name, folder, capsys):
    at(folder, name)
    assert new(folder, "plug.stl") == 2
    sentence(capsys, "plug.stl", THERE[name])
    write(folder, "fixture.toml", FILE)
    assert run(["worlds", f"{folder}/fixture.toml"]) == 2
    sentence(capsys, "fixture.toml: tool.mesh", THERE[name])


@pytest.mark.parametrize("name", ["folder", "pipe", "itself"])
def test_a_fixture_file_that_is_no_file_is_said(name, folder, capsys):
    at(folder, name)
    (folder / "plug.stl").rename(folder / "fixture.toml")
    if name == "itself":
        (folder / "plug.stl").symlink_to("fixture.toml")
    assert run(["worlds", f"{folder}/fixture.toml"]) == 2
    sentence(capsys, "fixture.toml", THERE[name])


def test_a_name_that_is_no_text_is_said(folder, capsys):
    path = os.fsencode(folder) + b"/plug\xff.stl"
    with open(path, "wb") as file:
        file.write(binary_stl(V, F))
    assert new(folder, os.fsdecode(b"plug\xff.stl")) == 2
    sentence(capsys, "no text in UTF-8", "rename it")


def test_a_line_break_in_a_name_does_not_break_the_fixture_file(folder, capsys):
    write(folder, "a\nb.stl", binary_stl(V, F))
    assert new(folder, "a\nb.stl") == 0


PIN, HOLE = round_pair()
BLOCK = box((-18, -18, -30), (18, 18, 0))
PAIRS = {
    # held, standing, more arguments, words of the sentence
    "a plug thicker than its hole": (rod(6.0, -12, 8), HOLE, (), "overlap by 0.57 mm"),
    "moved aside": (PIN.translate([0.7, 0, 0]), HOLE, (), "overlap by"),
    "far away": (PIN.translate([0, 0, 300]), HOLE, (), "lies 288 mm from"),
    "on top": (PIN.translate([0, 0, 12.0]), HOLE, (), "nothing of it lies below a hole entrance"),
    "the same part twice": (PIN, PIN, (), "one and the same mesh"),
    "one in metres": (in_metres(PIN), HOLE, (), 'say units = "m"'),
    "a press fit": (rod(5, -12, 8, 4), box((-15, -15, -17), (15, 15, 0)) - rod(5, -12, 1, 4), (), "play along the way"),
    "shut in": (box((-2, -2, -8), (2, 2, -4)), HOLE + box((-15, -15, 0), (15, 15, 3)), (), "more than one straight"),
    "across": (PIN, HOLE, ("--axis", "[1, 0, 0]"), "cannot leave plug_socket.stl along (-1, 0, 0)"),
    "no axis": (PIN, HOLE, ("--axis", "down"), "--axis 'down': is no direction"),
    "an axis of nothing": (PIN, HOLE, ("--axis", "[0, 0, 0]"), "is no direction"),
    "an axis that is TOML": (PIN, HOLE, ("--axis", "[0, 0, -1]\nfriction = 3"), "is no direction"),
    "no folder": (PIN, HOLE, ("--out", "none/fixture.toml"), "there is no folder none"),
    "inches": (rod(9.95, -24, 40), BLOCK - rod(10, -24, 1), ("--units", "in"), "kg at 2700 kg/m3; check its units"),
    "units of another world": (PIN, HOLE, ("--units", "furlong"), "unknown value 'furlong'"),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_that_does_not_go_together_is_one_sentence_and_leaves_nothing(name, folder, capsys):
    held, standing, more, words = PAIRS[name]
    export(held, folder / "plug.stl")
    export(standing, folder / "plug_socket.stl")
    before = sorted(os.listdir(folder))
    assert new(folder, "plug.stl", *more, socket="plug_socket.stl") == 2
    sentence(capsys, words)
    assert sorted(os.listdir(folder)) == before


def test_units_that_are_not_given_are_asked_for_by_the_word_to_type(folder, capsys):
    write(folder, "plug.stl", binary_stl(V, F))
    assert new(folder, "plug.stl", units=None) == 2
    sentence(capsys, "--units: is missing: it does not stand in plug.stl and socket.stl", "--units mm")


def test_units_of_two_glb_files_are_taken_where_they_are_given(folder, capsys):
    write(folder, "plug.glb", glb(*scene(P, T)))
    export(round_pair()[1], folder / "socket.glb")
    assert new(folder, "plug.glb", socket="socket.glb") == 0
    assert "goes 12 mm deep" in capsys.readouterr().out
    assert (folder / "fixture.toml").read_text().count('units = "mm"') == 2


def test_swapped_parts_are_asked_about(folder, capsys):
    write(folder, "plug.stl", binary_stl(V, F))
    assert new(folder, "socket.stl", socket="plug.stl") == 0
    assert "socket.stl, which is held, reaches around plug.stl" in capsys.readouterr().out
    (folder / "fixture.toml").unlink()
    assert new(folder, "plug.stl") == 0 and "note: " not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "words"),
    {
        "": "missing fixture, tool",
        FILE + "[task\n": "at line 9",
        FILE.replace("plug.stl", "old/plug.stl"): "no such file: 'old/plug.stl'",
        FILE.replace("plug.stl", "/etc/passwd"): "lies outside",
        FILE.replace('"plug.stl"', '""'): "is a folder: ''",
        FILE.replace('"plug.stl"', '"a\\u0000.stl"'): "cannot be opened",
        FILE.replace('"plug.stl"', f'"{"a" * 400}.stl"'): "too long",
        FILE.replace("[contact]", "tip = [0, 0, -12]\n[contact]"): "tool.tip: lies 1.2e+04 mm outside",
        FILE.replace("[tool]", "pose = { xyz = [nan, 0, 0] }\n[tool]"): "is not a number",
        FILE.replace("[contact]", "mass = 0\n[contact]"): "tool.mass: 0 kg is beyond",
    }.items(),
    ids=range(10),
)
def test_a_fixture_file_that_cannot_be_used_is_one_sentence(text, words, folder, capsys):
    write(folder, "plug.stl", binary_stl(V, F))
    write(folder, "fixture.toml", text)
    assert run(["worlds", f"{folder}/fixture.toml"]) == 2
    sentence(capsys, words)


@pytest.mark.slow
def test_a_damaged_cache_is_made_again_with_a_warning(folder, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    write(folder, "plug.stl", binary_stl(V, F))
    assert new(folder, "plug.stl") == 0
    kept = list((folder / "cache").rglob("*.json"))
    for file in kept:
        file.write_text('{"hulls": 3')
    load._LOADED.clear()
    (folder / "fixture.toml").unlink()
    with pytest.warns(SkillframeWarning, match="was damaged"):
        assert new(folder, "plug.stl") == 0
    assert len(kept) == 2 and all(file.read_text().endswith("}") for file in kept)
