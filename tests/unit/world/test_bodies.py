"""Links against obstacles, links and tools: found by closed forms, and pairs that may touch are left alone."""

import dataclasses

import numpy as np
import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.robot.tables import DeclaredCollisions, Obstacle
from skillframe.skill import Ended
from skillframe.world.collisions import Collisions, at_home
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from skillframe.world.scene import Geom
from tests.laws.pushing import Hold, Push
from tests.laws.runs import run, setup

STIFF = np.diag([1000.0] * 3 + [20.0] * 3)
INERTIAL = '<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
ARM = '[[arm]]\nname = "arm"\ntool_frame = "l4"\n'


def chain(folder, radii=(0.04, 0.04, 0.04, 0.04), length=0.3, more="", home=""):
    """A planar chain: a base, then links of 0.3 m about z, each a ball at its own joint; a short last one is the tool.

    Link i's joint is at the end of link i - 1, so that with all joints at zero the balls stand 0.3 m apart along x.
    """
    text = '<robot name="chain"><link name="base"/>'
    for i, radius in enumerate(radii):
        ball = f'<visual><geometry><sphere radius="{radius}"/></geometry></visual>'
        text += f'<link name="l{i}">{INERTIAL}{ball}</link><joint name="j{i}" type="revolute"><axis xyz="0 0 1"/>'
        text += f'<origin xyz="{length if i else 0} 0 0"/><parent link="{f"l{i - 1}" if i else "base"}"/>'
        text += f'<child link="l{i}"/><limit lower="-3.14" upper="3.14" effort="9" velocity="9"/></joint>'
    text += '<link name="l4"/><joint name="t" type="fixed"><parent link="l3"/><child link="l4"/></joint></robot>'
    (folder / "chain.urdf").write_text(text)
    (folder / "robot.toml").write_text(f'urdf = "chain.urdf"\n{ARM}{more}\n{home}')
    return load_model(load_robot(folder / "robot.toml"))


@pytest.fixture
def found(scene):
    """What is found in a robot's posture, as (first, second, depth in mm), with geoms of a fixture and of the tool."""

    def look(model, q, fixture=(), tool=()):
        now = scene("free")
        now = dataclasses.replace(now, fixture=tuple(fixture), tool=dataclasses.replace(now.tool, geoms=tuple(tool)))
        q = np.atleast_2d(np.array(q, dtype=float))
        plant = Plant(model, now, len(q), fixture_poses(model, {}, len(q)), {})
        plant.reset(q)
        return [
            (touch.row, touch.first, touch.second, round(1000 * touch.depth))
            for touch in Collisions(plant).touches(plant, np.arange(len(q)))
        ]

    return look


# --- links against links ---


def test_a_chain_that_folds_onto_itself_is_found_with_both_names(tmp_path, found):
    """Two turns by 2.5 rad make of three bars of 0.3 m a triangle's beginning: ball 3 is |0.3 (1 + e^2.5i + e^5i)|
    = 0.18 m from ball 0. Balls of 0.1 m are 20 mm in each other, to a millimetre; the other pairs are further apart."""
    apart = abs(0.3 * (1 + np.exp(2.5j) + np.exp(5j)))
    depth = round(1000 * (0.2 - apart))
    model = chain(tmp_path, radii=(0.1, 0.01, 0.01, 0.1))
    assert found(model, [[0, 2.5, 2.5, 0], [0, 0, 0, 0]]) == [(0, "link 'l0'", "link 'l3'", depth)]


def test_the_depth_of_two_links_does_not_depend_on_where_the_robot_stands(tmp_path, found):
    model = chain(tmp_path, radii=(0.1, 0.01, 0.01, 0.1))
    once = found(model, [0, 2.5, 2.5, 0])
    assert found(model, [1.3, 2.5, 2.5, -0.7]) == once


def test_links_that_one_joint_parts_may_overlap_and_those_that_two_part_only_if_they_do_at_home(tmp_path, found):
    """With balls of 0.2 m, 0.3 m apart, neighbours are in each other; of 0.31 m also those at 0.6 m."""
    kinds = {"neighbours": chain(tmp_path, radii=(0.2, 0.2, 0.2, 0.2))}
    assert found(kinds["neighbours"], [0, 0, 0, 0]) == []
    assert found(kinds["neighbours"], [0, 2.0, 0, 0])[0][1:3] == ("link 'l0'", "link 'l2'")
    model = chain(tmp_path, radii=(0.31, 0.01, 0.31, 0.01))
    assert "touch at home" in at_home(model).skipped.values()
    assert found(model, [0, 2.0, 0, 0]) == []


def test_links_far_from_each_other_that_touch_at_home_are_named_and_still_looked_at(tmp_path, found):
    model = chain(tmp_path, radii=(0.1, 0.01, 0.01, 0.1), home="[home]\nj1 = 2.5\nj2 = 2.5")
    known = at_home(model)
    names = [{known.parts[i].key for i in overlap.pair} for overlap in known.overlaps]
    assert names == [{"l0", "l3"}]
    assert found(model, model.home)[0][1:3] == ("link 'l0'", "link 'l3'")


def test_links_of_one_closed_loop_are_not_looked_at(robot):
    """The crane's cylinders lie between the parts that they turn."""
    known = at_home(robot("hiab_xs031"))
    loops = [{known.parts[i].key for i in pair} for pair, why in known.skipped.items() if why == "one loop"]
    assert {"pillar", "lift_rod"} in loops
    assert {"lift_boom", "lift_barrel"} in loops
    assert {"tilt_rod", "lift_boom"} in loops
    assert {"tilt_rod", "lift_rod"} not in loops
    assert not known.overlaps


def test_the_base_of_the_other_arm_is_no_neighbour(robot):
    known = at_home(robot("dual_panda"))
    skipped = [{known.parts[i].key for i in pair} for pair in known.skipped]
    assert {"left_base", "left_link1"} in skipped
    assert {"right_base", "left_link1"} not in skipped
    assert {"left_link7", "right_link7"} not in skipped


# --- obstacles ---


TABLE = '[[obstacle]]\nname = "table"\nkind = "box"\nsize = [0.2, 0.2, 0.2]\nposition = [0.6, 0.2, 0.0]\n'


def test_a_link_in_an_obstacle_is_found_by_name(tmp_path, found):
    """Ball 2 stands at x = 0.6 m; the table's face at y = 0.1 m: a ball of 0.13 m is 30 mm inside."""
    model = chain(tmp_path, radii=(0.04, 0.04, 0.13, 0.04), more=TABLE)
    assert found(model, [0, 0, 0, 0]) == [(0, "link 'l2'", "the obstacle 'table'", 30)]
    assert found(chain(tmp_path, radii=(0.04, 0.04, 0.09, 0.04), more=TABLE), [0, 0, 0, 0]) == []


def test_a_plane_holds_all_that_is_below_it_and_not_what_stands_still(tmp_path, found):
    """A wall at x = 0.5 m whose free side is towards the base: what is beyond counts, by how far it is beyond."""
    half = 0.5**0.5
    wall = (
        f'[[obstacle]]\nname = "wall"\nkind = "plane"\nposition = [0.85, 0, 0]\norientation = [0, {-half}, 0, {half}]\n'
    )
    model = chain(tmp_path, radii=(0.04, 0.04, 0.04, 0.06), more=wall)
    assert found(model, [0, 0, 0, 0]) == [(0, "link 'l3'", "the obstacle 'wall'", 110)]
    assert found(model, [np.pi, 0, 0, 0]) == []


def test_the_tool_in_an_obstacle_is_found_and_the_tool_in_the_fixture_is_not(tmp_path, found):
    """The tool is a ball of 50 mm at the last joint, at x = 0.9 m."""
    ball = Geom(kind="sphere", size=(0.05,))
    box = Geom(kind="box", size=(0.1, 0.1, 0.1), position=(0.9, 0.0, 0.0))
    table = TABLE.replace("[0.6, 0.2, 0.0]", "[0.9, 0.13, 0.0]")
    assert found(chain(tmp_path, radii=(0.01,) * 4), [0, 0, 0, 0], fixture=[box], tool=[ball])[0][1] == "link 'l3'"
    model = chain(tmp_path, radii=(0.01,) * 4, more=table)
    assert found(model, [0, 0, 0, 0], tool=[ball]) == [(0, "the tool", "the obstacle 'table'", 20)]


def test_the_tool_is_looked_at_against_the_arm_but_not_against_its_last_two_links(tmp_path, found):
    ball = Geom(kind="sphere", size=(0.35,))  # reaches l2 in any posture and, folded, l1 and l0
    model = chain(tmp_path, radii=(0.01,) * 4)
    assert found(model, [0, 0, 0, 0], tool=[ball]) == []
    assert found(model, [0, 0, 2.5, 0], tool=[ball])[0][1:3] == ("link 'l1'", "the tool")


def test_obstacles_that_cannot_be_are_refused_with_a_sentence(tmp_path):
    cases = {
        TABLE.replace("0.2, 0.2, 0.2", "0.2, 0, 0.2"): "give a box three positive edges in metres",
        TABLE + TABLE: "has a name that is taken",
        TABLE.replace("table", "fixture"): "has a name that is taken",
        TABLE.replace("table", "l1"): "is a link's name",
        TABLE.replace("0.6", "1e40"): "is beyond any physical size",
        TABLE.replace('"box"', '"plane"'): "is given, and a plane has no end",
        TABLE + "orientation = [0, 0, 0, 2]\n": "has the length 2, not 1",
    }
    for text, sentence in cases.items():
        with pytest.raises(InputError, match=sentence):
            chain(tmp_path, more=text)
    with pytest.raises(UnknownName, match="did you mean 'l1'"):
        chain(tmp_path, more='[collisions]\nignore = [["ll1", "l3"]]\n')


# --- what may touch ---


def test_pairs_that_robot_toml_names_are_not_looked_at(tmp_path, found):
    folded, radii = [0, 2.5, 2.5, 0], (0.1, 0.01, 0.01, 0.1)
    for pair in ('["l0", "l3"]', '["l3", "l0"]'):
        assert found(chain(tmp_path, radii, more=f"[collisions]\nignore = [{pair}]\n"), folded) == []
    assert found(chain(tmp_path, radii, more='[collisions]\nignore = [["l1", "l3"]]\n'), folded) != []
    inside = Geom(kind="box", size=(0.1, 0.1, 0.1), position=(0.6, 0.0, 0.0))
    model = chain(tmp_path, more='[collisions]\nignore = [["l2", "fixture"]]\n')
    assert found(model, [0, 0, 0, 0], fixture=[inside]) == []


def test_nothing_is_looked_at_where_robot_toml_says_so(tmp_path, found):
    model = chain(tmp_path, (0.1, 0.01, 0.01, 0.1), more="[collisions]\nenabled = false\n")
    assert found(model, [0, 2.5, 2.5, 0]) == []


def with_spec(setting, **spec):
    robot = setting.robot
    return dataclasses.replace(setting, robot=dataclasses.replace(robot, spec=dataclasses.replace(robot.spec, **spec)))


def test_a_run_without_the_switch_says_so_and_one_with_it_says_nothing():
    now = setup("panda", "free")
    for collisions, said in (
        (DeclaredCollisions(), None),
        (DeclaredCollisions(enabled=False), "bodies that touch did not end a trial"),
        (DeclaredCollisions(ignore=(("link1", "link4"),)), "link1 with link4"),
    ):
        result = run(Hold(STIFF), with_spec(now, collisions=collisions), duration_s=0.02, trace_hz=100.0)
        found = result.traces[0].meta["notes"]
        assert (found == []) if said is None else said in found[0]


# --- runs ---


def test_the_tool_that_comes_down_on_a_table_ends_the_trial_with_both_names():
    """The tip starts 50 mm over the fixture's place at z = 0.2 m and goes down at 0.1 m/s; a table 20 mm under the tip
    is met after 0.2 s, is found once it is 1 mm in, and is looked for every 10 ms."""
    table = Obstacle(name="table", size=(0.4, 0.4, 0.1), position=(0.5, 0.0, 0.18))
    now = with_spec(setup("panda", "free"), obstacle=(table,))
    result = run(Push((0.0, 0.0, -1.0), STIFF, speed=0.1, stall=False), now, duration_s=2.0, trace_hz=100.0)
    assert result.ended_by[0] == Ended.COLLISION
    assert not result.success[0]
    assert result.failure[0].startswith("the tool is ")
    assert "inside the obstacle 'table' (at 0." in result.failure[0]
    assert result.traces[0].meta["touched"] == ["the tool", "the obstacle 'table'"]
    drawn = next(body for body in result.traces[0].meta["bodies"] if body["name"] == "robot_base")
    assert [0.2, 0.2, 0.05] in [geom["size"] for geom in drawn["geoms"]]


@pytest.mark.slow
def test_bodies_that_touch_push_on_nothing_and_change_no_bit():
    """With a table that is never reached, with one that links stand in from the start and nobody looks, and without
    any, the robot moves alike to the last bit."""
    under = Obstacle(name="floor", kind="plane", position=(0.0, 0.0, -0.1))
    through = Obstacle(name="block", size=(0.3, 0.3, 0.3), position=(0.3, 0.0, 0.6))
    skill, now = Push((0.0, 0.0, -1.0), STIFF, speed=0.05, stall=False), setup("panda", "valley")
    plain = run(skill, now, duration_s=1.0, trace_hz=200.0).traces[0]
    kinds = (
        {"obstacle": (under,)},
        {"obstacle": (through,), "collisions": DeclaredCollisions(enabled=False)},
        {"collisions": DeclaredCollisions(enabled=False)},
    )
    for kind in kinds:
        other = run(skill, with_spec(now, **kind), duration_s=1.0, trace_hz=200.0).traces[0]
        for name in ("q", "v", "wrench", "wrench_true", "tau"):
            if hasattr(plain, name):
                assert np.array_equal(getattr(plain, name), getattr(other, name)), name


def test_a_skill_that_ends_between_two_looks_is_looked_at_then():
    """It ends with success 5 ms after the start, in a posture that touches since the start is over: with the looks
    before the start and at 0 s taken away, the one at the end finds it."""
    block = Obstacle(name="block", size=(0.3, 0.3, 0.3), position=(0.3, 0.0, 0.6))
    now = with_spec(setup("panda", "free"), obstacle=(block,))
    looks = []
    original = Collisions.touches

    def first_is_blind(self, plant, rows, *depth):
        looks.append(len(rows))
        return [] if len(looks) <= 2 else original(self, plant, rows, *depth)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Collisions, "touches", first_is_blind)
        result = run(Hold(STIFF, end=(0.005, 1, "there")), now, duration_s=0.1)
    assert result.ended_by[0] == Ended.COLLISION
    assert result.duration_s[0] < 0.0099


# --- what robots says and checks ---


def test_show_lists_pairs_that_are_not_looked_at_and_obstacles(robot, tmp_path):
    from skillframe.world.collisions import collision_lines, collision_values

    text = "\n".join(collision_lines(robot("panda")))
    assert "neighbours: base-link1, link1-link2" in text
    assert "overlapping at home: link5-link7" in text
    text = "\n".join(collision_lines(chain(tmp_path, more=TABLE)))
    assert "obstacle 'table': box of 0.2 x 0.2 x 0.2 m at (0.6, 0.2, 0) m" in text
    values = collision_values(robot("panda"))
    assert values["not_looked_at"]["touch at home"] == [["link5", "link7"]]
    assert values["not_looked_at"]["holds it"] == [["link6", "flange"], ["link7", "flange"]]
    off = chain(tmp_path, more="[collisions]\nenabled = false\n")
    assert "not checked" in collision_lines(off)[-1]
    assert collision_values(off)["enabled"] is False


def test_check_names_a_home_in_self_collision_or_in_an_obstacle(tmp_path):
    """Balls 0 and 3 stand 0.18 m apart at home; ball 2 is 30 mm in the table of the test above."""
    from skillframe.world.collisions import collision_problems

    model = chain(tmp_path, radii=(0.1, 0.01, 0.01, 0.1), home="[home]\nj1 = 2.5\nj2 = 2.5")
    (problem,) = collision_problems(model)
    depth = 1000 * (0.2 - abs(0.3 * (1 + np.exp(2.5j) + np.exp(5j))))
    assert problem.message == f"at home link 'l0' is {depth:.0f} mm inside link 'l3'"
    assert '[["l0", "l3"]]' in problem.fix
    (problem,) = collision_problems(chain(tmp_path, radii=(0.04, 0.04, 0.13, 0.04), more=TABLE))
    assert problem.message == "at home link 'l2' is 30 mm inside the obstacle 'table'"
    assert not list(collision_problems(chain(tmp_path)))


@pytest.mark.parametrize("name", ["panda", "dual_panda", "panda_servo", "panda_position", "hiab_xs031", "free_tool"])
def test_no_shipped_robot_touches_itself_at_home(robot, name):
    assert not at_home(robot(name)).overlaps
