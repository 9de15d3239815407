"""Parts as surfaces in MuJoCo: chosen where pieces do not hold, a block's weight and height, the same in a batch."""

import ctypes
from dataclasses import replace

import mujoco
import mujoco.batch
import numpy as np
import pytest
from skillframe_parts.field import surface_of
from skillframe_parts.found import lines, values
from skillframe_parts.load import load
from skillframe_parts.solid import arrays_of
from skillframe_parts.world import stated
from skillframe_testkit.checks.worlds import check_world

from skillframe.errors import InputError
from skillframe.extend.registry import registry
from skillframe.fmu.build import build_library
from skillframe.world import surfaces
from skillframe.world.convert import add_geom
from skillframe.world.scene import Geom
from skillframe.world.surfaces import available, opened
from tests.part_meshes import FILE, box, hole, in_metres, rod, round_pair, write

needs_compiler = pytest.mark.skipif(not available(), reason="needs a C compiler")


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr("skillframe_parts.field.MOST_NODES", 1e5)
    monkeypatch.setattr("skillframe_parts.field._COARSE_NODES", 2e4)


def pieces_are_few(monkeypatch):
    monkeypatch.setattr("skillframe_parts.load._LOADED", {})  # other parts of the same files are not these
    for name in ("checks.MOST_PIECES", "load.MOST_PIECES"):
        monkeypatch.setattr(f"skillframe_parts.{name}", 5)


def geom_of(solid):
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    vertices, faces = arrays_of(solid)
    return Geom(kind="mesh", vertices=vertices, faces=faces, surface=surface_of(solid, low - 0.01, high + 0.01))


def dropped(below, above, height, mass=0.1):
    """A free body of 0.1 kg over a fixed one."""
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    fixed, free = spec.worldbody.add_body(), spec.worldbody.add_body(pos=[0.0, 0.0, height])
    free.add_freejoint()
    free.mass, free.inertia, free.explicitinertial = mass, [1e-5, 1e-5, 1e-5], True
    add_geom(spec, fixed, below, "below", contype=1, conaffinity=2, friction=0.3)
    add_geom(spec, free, above, "above", contype=2, conaffinity=1, friction=0.3)
    return spec.compile()


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("table", [False, True])
def test_a_block_comes_to_rest_on_what_is_below_with_its_weight(table):
    """On a part with a hole, over which it reaches, and on a box. Contacts sink by less than 0.1 mm."""
    below = Geom(kind="box", size=(0.05, 0.05, 0.01), position=(0.0, 0.0, -0.01)) if table else None
    below = below or geom_of(in_metres(hole(5.0, 6.0, 24)))
    above = geom_of(in_metres(box((-8, -8, 0), (8, 8, 6))))
    model = dropped(below, above, 2e-4)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 600)
    assert -1e-4 < data.qpos[2] < 0.0 and np.abs(data.qpos[:2]).max() < 2e-4  # it slid less than it fell
    assert np.abs(data.qvel).max() < 1e-3  # m/s and rad/s: the whole fall was 0.06 m/s
    force = np.zeros(6)
    up = 0.0
    for index in range(data.ncon):
        mujoco.mj_contactForce(model, data, index, force)
        up += force[:3] @ data.contact[index].frame.reshape(3, 3)[:, 2]
    assert up == pytest.approx(0.1 * 9.81, rel=1e-3)  # at rest
    del above, below  # the generator knows them by number as long as they live


@needs_compiler
def test_what_is_in_the_hole_does_not_touch_and_what_is_beside_it_does():
    """MuJoCo alone takes the hull of a block with a hole, in which a pin would collide everywhere."""
    below, pin = geom_of(in_metres(hole(5.2, 12.0, 24))), geom_of(in_metres(rod(5.0, -3.0, 8.0, 24)))
    model = dropped(below, pin, 0.0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    data.qpos[0] = 3e-4  # a corner of the pin, at 5.3 mm, between two walls at 5.2 mm
    mujoco.mj_forward(model, data)
    assert data.ncon and min(data.contact.dist) == pytest.approx(5.2e-3 - 5.3e-3 * np.cos(np.pi / 24), abs=2e-6)
    for contact in data.contact:  # from the wall at +x to the pin
        assert contact.frame[0] < -0.5
    del below, pin


def contacts_along(model, places, forget=lambda: None):
    """Of each of some places (T, 7): distances, positions and frames of all contacts, (n, 13) in order."""
    data, found = mujoco.MjData(model), []
    for place in places:
        forget()
        data.qpos[:] = place
        mujoco.mj_forward(model, data)
        contact = data.contact
        found.append(np.column_stack([contact.dist, contact.pos, contact.frame]))
    return found


def walk(low, high, most_turn):
    """Places (2000, 7) of a part that moves by 1 um to 0.4 mm and up to half a degree at a time, held within a box."""
    rng = np.random.default_rng(5)
    size, place, turn = 10.0 ** rng.uniform(-6.0, -3.4, 2000), np.mean([low, high], axis=0), np.zeros(3)
    found = []
    for step in size:
        place = np.clip(place + step * rng.standard_normal(3), low, high)
        turn = np.clip(turn + 20.0 * step * rng.standard_normal(3), -most_turn, most_turn)
        found.append([*place, 1.0, *0.5 * turn])  # MuJoCo makes a unit quaternion of it
    return np.array(found)


BLOCK = hole(5.2, 12.0, 24), box((-8, -8, 0), (8, 8, 6))
PAIRS = {
    "a pin in a hole": ((hole(5.2, 12.0, 24), rod(5.0, -3.0, 8.0, 24)), walk([-2e-4] * 3, [2e-4] * 3, 0.01)),
    "a block over it": (BLOCK, walk([-1e-3] * 3, [1e-3, 1e-3, 2e-3], 0.1)),
    "a block that turns": (BLOCK, walk([0.0, 0.0, 3e-4], [0.0, 0.0, 3e-4], 0.1)),
}


@needs_compiler
@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.slow
def test_a_part_that_moves_on_meets_what_it_meets_where_no_near_points_were_kept(name):
    """In and out of touch, thousands of times. That another part is put in makes the generator forget."""
    (below, above), places = PAIRS[name]
    below, above = geom_of(in_metres(below)), geom_of(in_metres(above))
    model = dropped(below, above, 0.0)
    unused = surfaces._part(below.surface)

    def forget():
        library = surfaces._require()
        library.skillframe_remove(library.skillframe_add(ctypes.byref(unused)))

    kept, fresh = contacts_along(model, places), contacts_along(model, places, forget)
    touched = [len(each) > 0 for each in kept]
    assert np.count_nonzero(np.diff(touched)) > 20
    for mine, theirs in zip(kept, fresh, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    del below, above


@needs_compiler
def test_near_points_of_a_part_that_was_taken_out_are_not_those_of_one_in_its_place():
    """The same number and the same record in memory, as may come about by chance: a wider hole, then one too narrow."""
    wide, narrow = (geom_of(in_metres(hole(radius, 12.0, 24))) for radius in (5.2, 4.9))
    pin = geom_of(in_metres(rod(5.0, -3.0, 8.0, 24)))
    model, library, record = dropped(wide, pin, 0.0), surfaces._require(), surfaces._part(wide.surface)
    number = library.skillframe_add(ctypes.byref(record))
    model.geom_user[0, 0] = number
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    library.skillframe_remove(number)
    other = surfaces._part(narrow.surface)
    ctypes.memmove(ctypes.byref(record), ctypes.byref(other), ctypes.sizeof(record))
    assert library.skillframe_add(ctypes.byref(record)) == number
    found = [contacts_along(model, [data.qpos])[0]]
    mujoco.mj_forward(model, data)  # with what it knew of the wider one
    found.append(np.column_stack([data.contact.dist, data.contact.pos, data.contact.frame]))
    library.skillframe_remove(number)
    assert len(found[0]) and np.array_equal(*found)
    del wide, narrow, pin


@needs_compiler
def test_a_mesh_that_crosses_itself_does_not_agree_on_what_is_inside_and_others_do():
    """Rays that cross twice are outside, where two boxes overlap, and the nearest triangle says inside."""
    whole = geom_of(in_metres(hole(5.2, 12.0, 24))).surface
    two = [arrays_of(in_metres(box(low, [v + 6.0 for v in low]))) for low in ((0.0, 0.0, 0.0), (3.0, 3.0, 3.0))]
    corners, faces = (np.concatenate(each) for each in zip(*two, strict=True))
    faces[len(two[0][1]) :] += len(two[0][0])
    triangles = surfaces.triangles_of(corners, faces)
    grid = surfaces.grid_of(triangles, np.full(3, -0.001), np.full(3, 0.010), 2e-4)
    crossed = replace(whole, triangles=triangles, grids=(grid,))
    agrees = [surfaces._require().skillframe_agrees(ctypes.byref(surfaces._part(each))) for each in (whole, crossed)]
    assert agrees == [1, 0]


@pytest.mark.slow
@needs_compiler
def test_trials_are_the_same_to_the_bit_alone_and_in_a_batch():
    below, pin = geom_of(in_metres(hole(5.2, 12.0, 24))), geom_of(in_metres(rod(5.0, -3.0, 8.0, 24)))
    model = dropped(below, pin, 1e-4)
    shift = np.array([-1e-4, 2e-4, 4e-4])
    ends = []
    for chosen in (shift, shift[:1], shift[1:]):
        batch = mujoco.batch.Batch(model, len(chosen), nthread=1, persistent=True)
        place, speed = batch.bind("qpos"), batch.bind("qvel")
        batch.reset()
        place[:, 0], speed[:, 0] = chosen, 0.3
        for _ in range(100):
            batch.step()
        ends.append(np.array(place))
    np.testing.assert_array_equal(ends[0], np.concatenate([ends[1], ends[2]]))
    assert not np.array_equal(ends[0][0], ends[0][1])
    del below, pin


@pytest.mark.slow
@needs_compiler
def test_a_pair_that_pieces_do_not_hold_gets_surfaces_and_says_so(tmp_path, monkeypatch):
    pieces_are_few(monkeypatch)
    loaded = load(write(tmp_path, *round_pair()))
    assert loaded.backend == stated(loaded)["backend"] == values(loaded)["backend"] == "surface"
    assert stated(loaded)["pieces"] == 0 and 0.0 < stated(loaded)["contact_error"] < 0.25 * loaded.fit.clearance
    assert any("contact by our own generator" in line and "contact error" in line for line in lines(loaded))


@pytest.mark.slow
@needs_compiler
def test_a_fixture_file_can_ask_for_one_kind_of_contact(tmp_path, monkeypatch):
    def asked(by):
        return write(tmp_path / by, *round_pair(), FILE.replace("[contact]\n", f'[contact]\nby = "{by}"\n'))

    assert load(asked("surface")).backend == "surface" and load(asked("auto")).backend == "pieces"
    monkeypatch.setattr("skillframe_parts.load._LOADED", {})
    monkeypatch.setattr("skillframe_parts.load.available", lambda: False)
    with pytest.raises(InputError, match=r'contact\.by: is "surface", and there is no C compiler .*; install'):
        load(asked("surface"))
    pieces_are_few(monkeypatch)
    with pytest.raises(InputError, match=r'socket\.stl: .* convex pieces .*, and contact\.by is "pieces"'):
        load(asked("pieces"))


@pytest.mark.slow
@needs_compiler
def test_thinned_pieces_give_way_to_surfaces_where_there_is_a_compiler(tmp_path, monkeypatch):
    """A hole of 200 sides is thinned until 150 pieces hold it, which are off by more than a surface."""
    path = write(tmp_path, *round_pair(sides=200))
    assert load(path).backend == "surface"
    monkeypatch.setattr("skillframe_parts.load._LOADED", {})
    monkeypatch.setattr("skillframe_parts.load.available", lambda: False)
    assert load(path).backend == "pieces" and load(path).plug.pieces is not None


@pytest.mark.slow
@needs_compiler
def test_a_part_whose_surface_is_not_exact_enough_is_held_by_pieces(tmp_path, monkeypatch):
    def inexact(*_):
        raise InputError("socket.stl", "is not exact", "draw it again")

    monkeypatch.setattr("skillframe_parts.load._LOADED", {})
    monkeypatch.setattr("skillframe_parts.load._as_surface", inexact)
    path = write(tmp_path, *round_pair(sides=200))
    assert load(path).backend == "pieces"
    monkeypatch.setattr("skillframe_parts.load._LOADED", {})
    pieces_are_few(monkeypatch)
    with pytest.raises(InputError, match=r"socket\.stl: .* convex pieces .*, and as a surface is not exact"):
        load(path)


@pytest.mark.slow
@needs_compiler
def test_a_world_of_surfaces_conforms_as_any_world(tmp_path, monkeypatch):
    pieces_are_few(monkeypatch)
    path = write(tmp_path, *round_pair(), FILE)
    load(path)  # what is kept of it in the user's cache is the program's, not the world's
    assert check_world(registry().world(str(path))) == []


@pytest.mark.slow
def test_without_a_compiler_there_are_pieces_alone_and_one_sentence(tmp_path, monkeypatch):
    pieces_are_few(monkeypatch)
    monkeypatch.setattr("skillframe_parts.load.available", lambda: False)
    with pytest.raises(InputError, match=r"socket\.stl: takes .* convex pieces .*without a C compiler") as caught:
        load(write(tmp_path, *round_pair(), FILE))
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@needs_compiler
def test_a_library_that_is_damaged_in_the_cache_is_built_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    built = []

    def damaged_once(*args, **options):
        built.append(build_library(*args, **options))
        if len(built) == 1:
            built[0].write_bytes(b"damaged")
        return built[-1]

    monkeypatch.setattr("skillframe.world.surfaces.build_library", damaged_once)
    found = opened()
    assert found is not None
    assert found.skillframe_version() == mujoco.mj_version()
    assert len(built) == 2
