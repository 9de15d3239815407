"""Where the way of a seating begins, by paths of a tip that are drawn by hand, and pushes that have none."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from seat_played import DOWN, Played, known, searching
from skillframe_search.example import seated
from skillframe_search.seat import SEARCHING
from skillframe_search.seat_learner import way_begins
from skillframe_search.seat_words import NOWHERE, describe, goes_nowhere
from skillframe_search.straight import straight_push

from skillframe.document.file import learned
from skillframe.errors import InputError
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import quaternion_from_matrix, rotation_matrix
from skillframe.skill import Impedance


def tip_path(*corners):
    """Places (T, 3) on straight lines between corners, 100 on each."""
    return np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(corners)])


def test_the_way_of_loose_parts_is_where_the_tip_came_from_and_not_where_it_slid():
    # straight down through a wide hole, then 2 mm aside on the shoulder, which is the first that is touched
    path = tip_path((0.0, 0.0, 0.02), (0.0, 0.0, 0.001), (0.002, 0.0, 0.0))
    begins = way_begins(path, 100)
    way = (path[-1] - begins) / np.linalg.norm(path[-1] - begins)
    assert np.degrees(np.arccos(-way[2])) < np.degrees(0.002 / 0.02) + 0.1  # the slide over all of the length
    slid = path[-1] - path[100]
    assert np.degrees(np.arccos(-slid[2] / np.linalg.norm(slid))) > 60.0  # what contact alone would have said


def test_where_contact_begins_early_or_the_tip_came_from_aside_the_way_begins_at_the_contact():
    down = tip_path((0.0, 0.0, 0.02), (0.0, 0.0, 0.012), (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(way_begins(down, 100), down[100])
    aside = tip_path((0.04, 0.0, 0.02), (0.0, 0.0, 0.01), (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(way_begins(aside, 100), aside[100])
    shallow = tip_path((0.0, 0.0, 0.02), (0.0, 0.0, 0.004), (0.0, 0.0, 0.0))  # a free way down, then a shallow hole
    np.testing.assert_array_equal(way_begins(shallow, 100), shallow[100])
    np.testing.assert_array_equal(way_begins(shallow, 100, 0.002), shallow[100])


def test_where_it_rests_as_soon_as_it_touches_the_way_is_the_one_that_it_came():
    bottom = tip_path((0.0, 0.0, 0.006), (0.0, 0.0, 0.001), (0.0, 0.0, 0.0))
    np.testing.assert_array_equal(way_begins(bottom, 100, 0.002), bottom[0])
    np.testing.assert_array_equal(way_begins(bottom, 100), bottom[100])


def resting(high_m, *forces):
    """A made-up demonstration that ends higher, and rests there for 0.3 s with each of these pushes [N]."""
    one = seated(0.0)
    rests = one.time[-1] + np.arange(1, 60 * len(forces) + 1) * np.median(np.diff(one.time))
    wrench = np.random.default_rng(2).standard_normal((len(rests), 6)) * np.repeat([0.05, 0.002], 3)
    wrench[:, 2] += np.repeat(forces, 60)
    stays = [np.repeat(values[-1:], len(rests), axis=0) for values in (one.position, one.quaternion)]
    return replace(
        one, time=np.concatenate([one.time, rests]), wrench=np.concatenate([one.wrench, wrench]),
        position=np.concatenate([one.position, stays[0]]) + np.array([0.0, 0.0, high_m]),
        quaternion=np.concatenate([one.quaternion, stays[1]]),
    )  # fmt: skip


def yawed(demonstration, angle):
    """The demonstration turned about the way by an angle [rad], or one at each sample."""
    c, s = np.broadcast_arrays(np.cos(angle), np.sin(angle), demonstration.time)[:2]
    yaw = np.zeros((len(demonstration.time), 3, 3))
    yaw[:, 0, 0] = yaw[:, 1, 1] = c
    yaw[:, 1, 0], yaw[:, 0, 1], yaw[:, 2, 2] = s, -s, 1.0
    about = np.array([0.4, 0.0, 0.0])
    position = np.einsum("tij,tj->ti", yaw, demonstration.position - about) + about
    quaternion = quaternion_from_matrix(yaw @ demonstration.pose.rotation)
    return replace(demonstration, position=position, quaternion=quaternion)


def learned_of(*demonstrations, **settings):
    return learned(registry().skill("seat"), demonstrations, LearnOptions(settings=settings))


def end_of(*demonstrations, **settings):
    """The block `seat`, and how high its end is [mm]."""
    seat = learned_of(*demonstrations, **settings)["seat"]
    return seat, 1e3 * (seat["end"][2] - 0.2)


def test_the_end_is_that_of_the_demonstration_that_went_deepest():
    seat, height = end_of(resting(0.0, 10.0), resting(0.0004, 10.0))
    assert height == pytest.approx(0.0, abs=0.05) and seat["stop_m"] == 0.0
    alone = end_of(resting(0.0, 10.0))[0]["contact_m"]
    # the mean of both contacts, over the deeper end
    assert seat["contact_m"] == pytest.approx(alone + 0.0002, abs=5e-5)
    _, height = end_of(resting(0.0, 10.0), resting(0.0004, 10.0), place="start")  # both went as far: neither is short
    assert height == pytest.approx(0.2, abs=0.05)


def removal_of(one, aside=(0.003, -0.002, 0.001), angle=0.1):
    """A record of taking the part out: a demonstration backwards, elsewhere and turned about the way."""
    back = replace(
        one, time=one.time[-1] - one.time[::-1], position=one.position[::-1] + np.array(aside),
        quaternion=one.quaternion[::-1], wrench=-one.wrench[::-1],
    )  # fmt: skip
    return yawed(back, angle)


def test_a_removal_gives_place_way_and_orientation_and_the_push_goes_straight_along_the_way():
    one = seated(0.0)
    out = removal_of(one, angle=0.1 + np.linspace(0.0, 0.02, len(one.time)))  # it turns on its way out
    mine = learned_of(out, removal=True)
    seat = mine["seat"]
    tip = out.pose.at(np.array(seat["point"])).position
    np.testing.assert_allclose(seat["end"], tip[0], atol=1e-12)
    np.testing.assert_allclose(rotation_matrix(np.array(seat["orientation"])), out.pose.rotation[0], atol=1e-9)
    # the principal direction of the samples, whatever noise the first and the last have
    (value, vectors) = np.linalg.eigh(np.cov(tip.T))
    assert abs(vectors[:, np.argmax(value)] @ seat["way"]) == pytest.approx(1.0, abs=1e-9)
    assert seat["contact_m"] == pytest.approx((tip[0] - tip[-1]) @ seat["way"])
    np.testing.assert_allclose(mine["phases"][0]["translation"]["desired_direction"], seat["way"], atol=1e-12)
    assert any(line.startswith("by hand (our choice): the push;") for line in describe(mine))


def test_whether_something_stops_the_part_is_said_since_a_removal_does_not_show_it():
    out = removal_of(seated(0.0))
    assert learned_of(out, removal=True)["seat"]["stop_m"] == 0.0
    assert learned_of(out, removal=True, stopped=False)["seat"]["stop_m"] > 0.0


def test_a_removal_that_goes_nowhere_or_not_straight_is_refused_and_settings_of_a_learned_push_with_it():
    one = removal_of(seated(0.0), angle=0.0)
    rests = replace(one, position=np.repeat(one.position[:1], len(one.time), axis=0))
    angle = np.linspace(0.0, 0.8 * np.pi, len(one.time))
    arc = one.position[:1] + 0.02 * np.column_stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)])
    for each in (rests, replace(one, position=arc)):
        with pytest.raises(InputError, match="until the part is out"):
            learned_of(each, removal=True)
    for name, value in {"moving_m": 0.002, "skill": "dmp"}.items():
        with pytest.raises(InputError, match=f"--set {name}: is of a learned push"):
            learned_of(one, removal=True, **{name: value})


def test_a_straight_push_in_another_direction_is_the_one_down_turned():
    frames = {"tip": (0.0, 0.0, 0.2)}
    turn = rotation_matrix(np.array([0.4, -1.1, 0.3]))
    down, other = (straight_push(frames, way)["phases"][0]["translation"]
                   for way in (np.array([0.0, 0.0, -1.0]), turn @ [0.0, 0.0, -1.0]))  # fmt: skip
    for key in ("stiffness", "damping"):
        np.testing.assert_allclose(other[key], turn @ np.array(down[key]) @ turn.T, atol=1e-9)
    free = np.array(other["compliant_axes"])
    np.testing.assert_allclose(free @ free.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(free @ other["desired_direction"], 0.0, atol=1e-12)


def test_where_all_rest_without_pressing_nothing_stops_the_part_and_the_end_is_their_mean():
    seat, height = end_of(resting(0.0, 1.0), resting(0.0004, 1.0))
    assert height == pytest.approx(0.2, abs=0.05) and seat["stop_m"] > 0.0
    leant = (resting(0.0, 0.0, 5.1), resting(0.0, 0.0, 0.3))  # one on a post that goes through (AutoMate 00486)
    assert end_of(*leant)[0]["stop_m"] > 0.0 and end_of(resting(0.0, 0.0, 4.0))[0]["stop_m"] > 0.0
    pressed = resting(0.0, 0.0, 9.7)  # the lightest press on a bottom (00117)
    assert end_of(pressed)[0]["stop_m"] == 0.0 and end_of(pressed, resting(0.0, 0.0, 3.0))[0]["stop_m"] == 0.0
    assert any(line.startswith("stop:") for line in describe(learned_of(resting(0.0, 1.0))))
    assert not any(line.startswith("stop:") for line in describe(learned_of(resting(0.0, 10.0))))


def test_a_push_is_learned_until_the_part_is_at_its_end_where_nothing_stops_it(monkeypatch):
    """0.3 s before the contact, 1.5 s of it down to within 0.3 mm of the end (0.04 s before it), 0.3 s of standing."""
    seen, told = [], []
    real = registry().skill("lmc")

    def learn(given, options):
        seen.append(round(given[0].duration, 1))
        told.append(options)
        return real.learn(given, options)

    known(monkeypatch, lmc=replace(real, learn=learn))
    for force in (1.0, 10.0):
        seat, _ = end_of(resting(0.0, force))
    assert seen == [1.8, 2.1] and list(told[1].toward) == seat["way"] and told[1].straight


@pytest.mark.parametrize("slant", [0.0, 0.4])
def test_a_part_that_nothing_stops_is_pushed_less_and_less_before_the_end_and_not_beyond_it(slant):
    """Stiff along one direction alone, which may slant: then a lead aside pushes along the way, too."""
    stiff = np.array([np.sin(slant), 0.0, -np.cos(slant)])
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3] = 1000.0 * np.outer(stiff, stiff)
    played = Played(stop_m=0.001)
    played.push.impedance = Impedance(stiffness)
    for deep, share in ((-0.002, 1.0), (-0.001, 1.0), (-0.0004, 0.4), (0.0, 0.0), (0.001, 0.0)):
        played.deep[:] = deep
        played.push.lead, played.push.speed = np.array([0.002, 0.0, -0.010]), 0.02
        command = played.go()
        lead = command.pose.position - played.seen().pose.position
        force = lead @ stiffness[:3, :3] + command.feedforward[:, :3] - 1.0  # the script's own feed-forward
        pushed = 1000.0 * (0.002 * np.sin(slant) + 0.010 * np.cos(slant)) * np.cos(slant)
        np.testing.assert_allclose(force @ DOWN, pushed * share, atol=1e-9)
        np.testing.assert_allclose(command.twist[:, 2], -0.02 * share, atol=1e-9)
    played.push.lead = np.array([0.0, 0.0, 0.010])  # what draws it back is left
    np.testing.assert_allclose(played.go().feedforward[:, 2], 1.0, atol=1e-9)


def test_a_search_keeps_its_lead_where_nothing_stops_the_part():
    played = searching(stop_m=0.001)
    played.deep[:], played.search.lead = 0.0, np.array([0.001, 0.0, -0.010])
    command = played.go()
    assert (played.skill.current == SEARCHING).any()
    there = played.skill.current == SEARCHING
    np.testing.assert_allclose((command.pose.position - played.seen().pose.position)[there, 2], -0.010, atol=1e-9)


def test_a_part_is_settled_unless_that_is_left_out():
    assert end_of(resting(0.0, 10.0))[0]["settle_s"] == 0.5
    assert end_of(resting(0.0, 10.0), settle=0.0)[0]["settle_s"] == 0.0
    assert any(line.startswith("settle:") for line in describe(learned_of(resting(0.0, 10.0))))
    none = learned(registry().skill("seat"), [resting(0.0, 10.0)], LearnOptions(settings={"settle": 0.0}))
    assert not any(line.startswith("settle:") for line in describe(none))


def test_who_lets_go_at_a_bottom_has_pressed_on_it_before():
    assert end_of(resting(0.0, 10.0, 0.0))[0]["stop_m"] == 0.0
    assert end_of(resting(0.0, 1.0), resting(0.0, 10.0))[0]["stop_m"] == 0.0
    assert end_of(seated(0.0))[0]["stop_m"] == 0.0  # cut off while it went on: it rests nowhere


def test_a_seating_says_where_its_push_has_no_direction():
    made = learned(registry().skill("seat"), [seated(0.14)], LearnOptions())
    assert NOWHERE not in describe(made)
    for part in ("translation", "rotation"):
        made["phases"][0][part] |= {"desired_direction": None, "speed": 0.0}
    assert NOWHERE in describe(made)
    assert not goes_nowhere({"of another kind": {}})  # whatever it does is not ours to know


def test_demonstrations_that_end_leaning_are_told_of_and_a_turn_about_the_way_is_no_lean():
    whole = [seated(0.14), seated(-0.14, 1)]
    kind = registry().skill("seat")
    # 2.1 s: half of the 0.14 rad is left
    leaning = learned(kind, [each.between(None, 2.1) for each in whole], LearnOptions())
    assert leaning["seat"]["leant_rad"] == pytest.approx(0.07, abs=0.001)
    assert any("leant up to 4.0 degrees from the mean" in line for line in describe(leaning))
    upright = learned(kind, [yawed(one, angle) for one, angle in zip(whole, (0.3, -0.3), strict=True)], LearnOptions())
    assert upright["seat"]["leant_rad"] < 0.002
    assert not any("leant" in line for line in describe(upright))


def test_what_is_screwed_in_is_refused_and_what_is_aligned_about_its_way_is_not():
    """Turned about the way from the contact, at 1.5 s, to the end: 20 degrees are a screw, 10 are not, nor are both."""
    inside = np.clip((seated(0.0).time - 1.5) / 1.2, 0.0, 1.0)
    with pytest.raises(InputError, match=r"turned by 20 degrees about its way.*leave --skill seat out"):
        learned_of(yawed(seated(0.0), np.radians(20.0) * inside))
    twisted = yawed(seated(0.0), np.radians(20.0) * inside)  # as people twist a round peg while they push it in
    assert learned_of(twisted, round=True)["phases"][0]["rotation"]["desired_direction"] is None
    for angles in ((10.0,), (20.0, -20.0)):
        made = learned_of(*(yawed(seated(0.0, i), np.radians(a) * inside) for i, a in enumerate(angles)))
        assert made["phases"][0]["rotation"]["desired_direction"] is None
    learned_of(yawed(seated(0.0), np.radians(20.0) * np.clip(seated(0.0).time / 1.0, 0.0, 1.0)))  # above the parts


def swaying(one):
    """The demonstration of one who came swaying, which is no straight way, and touched 1.6 mm over the end."""
    late = one.time < 2.8
    sway = np.where(late, 0.008 * np.sin(20.0 * (2.8 - one.time)), 0.0)
    return replace(
        one, position=one.position + sway[:, None] * np.array([1.0, 0.0, 0.0]),
        wrench=one.wrench - np.where(late & (one.time > 1.5), 10.0, 0.0)[:, None] * np.eye(6)[2],
    )  # fmt: skip


def test_who_touches_only_near_the_end_says_nothing_of_the_way_if_others_do():
    first = seated(0.0)
    with pytest.raises(InputError, match=r"1\.\d mm from first contact to end"):
        learned_of(swaying(first))
    alone, both = learned_of(first)["seat"], learned_of(first, swaying(first))["seat"]
    assert both["contact_m"] == pytest.approx(alone["contact_m"], abs=1e-4) and both["way"] == alone["way"]


def test_where_all_touch_only_near_the_end_the_way_is_that_in_which_they_pressed_at_rest():
    """It is as long as the least way, 2 mm. Who leans on a wall as hard as he presses shows none, and is refused."""
    seat = learned_of(swaying(resting(0.0, 10.0)))["seat"]
    assert np.array(seat["way"]) @ DOWN > np.cos(0.01) and seat["contact_m"] == pytest.approx(0.002, abs=1e-4)
    pressed = swaying(resting(0.0, 10.0))
    for aside, alone in ((10.0, False), (-30.0, True)):
        leaning = replace(pressed, wrench=pressed.wrench + aside * (pressed.time > 3.0)[:, None] * np.eye(6)[0])
        with pytest.raises(InputError, match="from first contact to end"):
            learned_of(leaning, *([] if alone else [replace(leaning, wrench=leaning.wrench * [-1, 1, 1, 1, 1, 1])]))
    with pytest.raises(InputError, match="from first contact to end"):
        learned_of(swaying(resting(0.0, 2.0)))
