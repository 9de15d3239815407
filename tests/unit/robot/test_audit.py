"""The audit: honest robots pass at any scale, impossible ones do not, and the cure that it prints cures."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from skillframe.robot.audit import SINGULAR, audit, pivot_ratios
from skillframe.robot.spec import load_robot

ALL_KINDS = ("revolute", "prismatic", "continuous", "planar", "floating", "fixed")
hypothesis_settings = settings(
    deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def check(path):
    return audit(load_robot(path))


def codes(result, severity=None):
    return {p.code for p in result.problems if severity in (None, p.severity)}


def pair(urdf, inertia, **joint):
    """A base and one moving link of reach 0.3 m (its child is a fixed tip)."""
    return urdf.robot(
        urdf.link("base"),
        urdf.link("arm", inertia),
        urdf.link("tip"),
        urdf.joint("j", "base", "arm", **joint),
        urdf.joint("k", "arm", "tip", "fixed", inside=""),
    )


def box_inertia(mass, moments):
    xx, yy, zz = moments
    moments = f'ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"'
    return f'<inertial><mass value="{mass}"/><inertia {moments}/></inertial>'


@hypothesis_settings
@given(seed=st.integers(0, 10**6), size=st.integers(1, 12), power=st.integers(-1, 3), free=st.booleans())
@pytest.mark.slow
def test_an_honest_tree_is_usable_at_every_scale_and_base(save, urdf, seed, size, power, free):
    """From centimetres to a kilometre. Travels are metres at every scale, and at their ends a tree of millimetres is
    singular to rounding: each sliding or floating joint makes the lever (3 m / 0.3 mm)^2 = 1e8 of what turns before
    it."""
    text = urdf.tree(seed, size, 10.0**power, ALL_KINDS)
    if free:
        text = text.replace('<link name="base"></link>', urdf.link("base", urdf.inertial(1000.0**power, 10.0**power)))
    result = check(save(text, 'base = "free"' if free else ""))
    assert codes(result, "fatal") == set()
    assert result.usable


def test_shipped_robots_have_no_problem_at_all():
    assert check("panda").problems == ()
    assert check("free_tool").problems == ()
    crane = check("hiab_xs031").problems  # its passive joints need no effort limits
    assert [p for p in crane if p.severity != "info"] == []
    assert check("panda").mass_kg == pytest.approx(
        4.970684 + 0.646926 + 3.228604 + 3.587895 + 1.225946 + 1.666555 + 0.735522
    )
    assert (check("free_tool").nq, check("free_tool").nv, check("free_tool").mass_kg) == (7, 6, 2.0)


def test_a_urdf_without_inertia_has_a_zero_mass_matrix(save, urdf):
    result = check(save(pair(urdf, "")))
    assert not result.usable
    assert codes(result) == {"zero_mass_matrix", "no_inertia"}


@pytest.mark.parametrize("axis", ["0 0 0", "0 0 1"])
def test_a_joint_that_moves_nothing_of_its_own_makes_the_mass_matrix_singular(save, urdf, axis):
    text = urdf.robot(
        urdf.link("base"),
        urdf.link("ring"),
        urdf.link("arm", urdf.inertial(2.0, 0.3)),
        urdf.joint("ring_joint", "base", "ring", axis=axis),
        urdf.joint("arm_joint", "ring", "arm", axis="0 0 1"),
    )
    result = check(save(text))
    assert [(p.code, p.where) for p in result.problems if p.severity == "fatal"] == [
        ("singular_mass_matrix", "ring_joint")
    ]


def test_a_massless_link_between_crossed_axes_is_only_a_warning(save, urdf):
    text = urdf.robot(
        urdf.link("base"),
        urdf.link("cross"),
        urdf.link("arm", urdf.inertial(2.0, 0.3)),
        urdf.joint("a", "base", "cross", axis="1 0 0"),
        urdf.joint("b", "cross", "arm", axis="0 1 0"),
    )
    result = check(save(text))
    assert result.usable
    assert codes(result) == {"no_inertia"}


def test_a_point_mass_on_the_axis_makes_the_mass_matrix_singular_and_beside_it_does_not(save, urdf):
    for com, usable in (("0 0 0.2", False), ("0.1 0 0.2", True)):
        point = f'<inertial><origin xyz="{com}"/>' + box_inertia(1.0, (0, 0, 0)).removeprefix("<inertial>")
        assert check(save(pair(urdf, point, axis="0 0 1"))).usable is usable


@hypothesis_settings
@given(low=st.floats(0.01, 1.0), middle=st.floats(0.01, 1.0), share=st.floats(0.05, 2.0), seed=st.integers(0, 1000))
def test_moments_are_refused_exactly_where_they_violate_the_triangle_inequality(save, urdf, low, middle, share, seed):
    moments = 1e-3 * np.array([low, middle, (low + middle) * share])
    least, next_to, high = sorted(moments)
    assume(abs(least + next_to - high) > 0.01 * high)  # a thousandth is allowed for rounding in URDFs
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    i = rotation @ np.diag(moments) @ rotation.T
    inside = (
        f'<inertial><mass value="1"/><inertia ixx="{i[0, 0]}" iyy="{i[1, 1]}" izz="{i[2, 2]}" '
        f'ixy="{i[0, 1]}" ixz="{i[0, 2]}" iyz="{i[1, 2]}"/></inertial>'
    )
    result = check(save(pair(urdf, inside)))
    assert ("impossible_inertia" in codes(result, "fatal")) == (least + next_to < high)


def test_a_flat_plate_and_a_thin_rod_are_possible_inertias(save, urdf):
    for moments in ((0.001, 0.002, 0.003), (0.002, 0.002, 0.0)):
        assert check(save(pair(urdf, box_inertia(1.0, moments)))).usable


@pytest.mark.parametrize(("mass", "moments"), [(-1.0, (0.01, 0.01, 0.01)), (1.0, (0.01, 0.01, -0.01))])
def test_negative_masses_and_moments_are_impossible(save, urdf, mass, moments):
    assert "impossible_inertia" in codes(check(save(pair(urdf, box_inertia(mass, moments)))), "fatal")


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_the_radius_of_gyration_may_be_three_times_the_reach_to_the_next_joint(save, urdf, factor):
    moment = 2.0 * (3.0 * 0.3 * factor) ** 2
    result = check(save(pair(urdf, box_inertia(2.0, (moment, moment, moment)))))
    assert ("oversized_inertia" in codes(result, "fatal")) == (factor > 1.0)
    assert result.usable == (factor < 1.0)


def test_geometry_counts_for_a_bodys_size_and_a_missing_mesh_gives_the_benefit_of_the_doubt(save, urdf):
    shapes = {
        '<sphere radius="1.0"/>': True,
        '<sphere radius="0.1"/>': False,
        '<mesh filename="package://gone/a.stl"/>': True,
    }
    far = urdf.link("far") + urdf.joint("f", "base", "far", "fixed", xyz="0 0 1", inside="")  # the largest link: 1 m
    for shape, usable in shapes.items():
        inside = box_inertia(1.0, (1.0, 1.0, 1.0)) + f"<visual><geometry>{shape}</geometry></visual>"
        assert check(save(pair(urdf, inside).replace("</robot>", far + "</robot>"))).usable is usable


def test_a_leaf_of_unknown_size_is_measured_against_the_largest_link(save, urdf):
    for reach, usable in ((0.3, False), (0.4, True)):
        text = urdf.robot(
            urdf.link("base"),
            urdf.link("leaf", box_inertia(1.0, (1, 1, 1))),
            urdf.joint("j", "base", "leaf", xyz=f"0 0 {reach}"),
        )
        assert check(save(text)).usable is usable


@hypothesis_settings
@example(seed=134, size=8, harm="negative")  # masses cancel to almost nothing
@given(
    seed=st.integers(0, 10**6), size=st.integers(2, 8), harm=st.sampled_from(["strip", "identity", "negative", "flat"])
)
@pytest.mark.slow
def test_the_overlay_that_a_problem_prints_cures_it(save, urdf, seed, size, harm):
    text = spoil(urdf.tree(seed, size, 1.0, ALL_KINDS), harm)
    overlay: dict[str, object] = {}
    for _ in range(3):  # a cured link can uncover another
        result = check(save(text, "\n".join(toml_lines(overlay))))
        if result.usable:
            break
        for problem in result.problems:
            if "\n[inertia]\n" in problem.fix:
                overlay |= tomllib.loads(problem.fix.split("\n", 1)[1])["inertia"]
    assert result.usable


def spoil(text, harm):
    head, *links = text.split("<inertial>")
    bad = {
        "strip": "",
        "identity": box_inertia(1.0, (9.0, 9.0, 9.0)),
        "negative": box_inertia(-1.0, (1.0, 1.0, 1.0)),
        "flat": box_inertia(1.0, (0.001, 0.001, 0.009)),
    }[harm]
    return head + "".join(bad + link.split("</inertial>")[1] for link in links)


def toml_lines(overlay):
    yield "[inertia]"
    for link, value in overlay.items():
        yield f"{link} = {{ mass = {value['mass']}, com = {value['com']}, inertia = {value['inertia']} }}"


def test_a_link_with_a_strange_name_gets_a_quoted_key(save, urdf):
    text = urdf.robot(
        urdf.link("base"),
        urdf.link('arm 1/"x".b'.replace('"', "&quot;")),
        urdf.joint("j", "base", "arm 1/&quot;x&quot;.b"),
    )
    fix = check(save(text)).problems[0].fix
    assert list(tomllib.loads(fix.split("\n", 1)[1])["inertia"]) == ['arm 1/"x".b']


def test_template_inertias_are_named_as_toys(save, urdf):
    same = box_inertia(1.0, (1.0, 1.0, 1.0))
    far = urdf.link("far") + urdf.joint("f", "arm", "far", "fixed", xyz="0 0 1", inside="")
    text = pair(urdf, same).replace('<link name="tip"></link>', urdf.link("tip", same))
    result = check(
        save(text.replace('<link name="base"></link>', urdf.link("base", same)).replace("</robot>", far + "</robot>"))
    )
    assert result.usable
    assert codes(result) == {"toy_inertia", "toy_mass"}


@pytest.mark.parametrize(("mass", "named"), [(1e-8, True), (0.9e-6, True), (2e-6, False), (0.0, False)])
def test_a_body_that_weighs_next_to_nothing_is_named_and_counts_with_what_is_fixed_to_it(save, urdf, mass, named):
    """The rest that moves weighs 1 kg. Fixed to a link of 0.1 kg, the same mass is part of a sound body."""
    small = urdf.inertial(mass, 0.02)
    parts = [
        urdf.link("base"), urdf.link("arm", urdf.inertial(1.0, 0.3)), urdf.link("tip", small),
        urdf.joint("j", "base", "arm"), urdf.joint("k", "arm", "tip", axis="0 1 0"),
    ]  # fmt: skip
    problems = [p for p in check(save(urdf.robot(*parts))).problems if p.code == "tiny_mass"]
    assert [(p.where, p.severity) for p in problems] == [("tip", "warning")] * named
    more = [urdf.link("pad", urdf.inertial(0.1, 0.05)), urdf.joint("f", "tip", "pad", "fixed", inside="")]
    assert "tiny_mass" not in codes(check(save(urdf.robot(*parts, *more))))


@pytest.mark.parametrize(
    ("joint", "code"),
    [
        ({"inside": '<limit lower="-1" upper="1" effort="0" velocity="1"/>'}, "no_effort_limits"),
        ({"inside": '<limit lower="-1" upper="1" velocity="1"/>'}, "no_effort_limits"),
        ({"inside": ""}, "no_position_limits"),
        ({"inside": '<limit lower="0" upper="0" effort="1" velocity="1"/>'}, "no_position_limits"),
        ({"inside": '<limit lower="1" upper="-1" effort="1" velocity="1"/>'}, "reversed_limits"),
        ({"kind": "continuous"}, "continuous"),
    ],
)
def test_doubtful_joints_are_warnings_and_the_robot_stays_usable(save, urdf, joint, code):
    result = check(save(pair(urdf, urdf.inertial(1.0, 0.3), **joint)))
    assert code in codes(result, "warning")
    assert result.usable


@pytest.mark.parametrize(("leader", "code", "nv"), [("j", "mimic", 1), ("nobody", "mimic_independent", 2)])
def test_mimic_joints_are_warnings_whether_they_follow_or_not(save, urdf, leader, code, nv):
    follow = f'{urdf.LIMIT}<mimic joint="{leader}"/>'
    text = urdf.robot(
        urdf.link("a"),
        urdf.link("b", urdf.inertial(1, 0.3)),
        urdf.link("c", urdf.inertial(1, 0.2)),
        urdf.joint("j", "a", "b"),
        urdf.joint("k", "a", "c", inside=follow),
    )
    result = check(save(text))
    assert (result.usable, result.nv, codes(result)) == (True, nv, {code})


def test_missing_meshes_are_warnings_named_once_each(save, urdf):
    shape = '<visual><geometry><mesh filename="package://gone/a.stl"/></geometry></visual>'
    result = check(save(pair(urdf, urdf.inertial(1.0, 0.3) + shape + shape.replace("visual", "collision"))))
    assert [p.code for p in result.problems] == ["missing_mesh"]
    assert "package://gone/a.stl" in result.problems[0].message
    assert result.usable


def test_a_robot_that_cannot_move_is_usable_and_says_so(save, urdf):
    result = check(save(urdf.robot(urdf.link("stone", urdf.inertial(1, 1)))))
    assert (result.usable, result.nq, codes(result)) == (True, 0, {"no_moving_joints"})


def test_loops_that_nothing_drives_are_told(save, urdf):
    toml = '[[loop]]\nframe_a = "arm"\nframe_b = "tip"\n'
    assert codes(check(save(pair(urdf, urdf.inertial(1, 0.3)), toml))) == {"not_driven"}


@hypothesis_settings
@given(seed=st.integers(0, 10**6), size=st.integers(1, 8), spread=st.floats(0.0, 8.0))
def test_pivot_ratios_do_not_depend_on_units_and_find_what_is_singular(seed, size, spread):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size + 3))
    mass, units = root @ root.T, 10.0 ** rng.uniform(-spread, spread, size)
    ratios = pivot_ratios(mass)
    np.testing.assert_allclose(pivot_ratios(mass * units[:, None] * units), ratios, rtol=1e-6)
    # elimination from the last row: product of the pivots is the determinant
    assert math.prod(ratios * np.diag(mass)) == pytest.approx(np.linalg.det(mass), rel=1e-6)
    copied = np.block([[mass, mass[:, :1]], [mass[:1], mass[:1, :1]]])
    assert (pivot_ratios(copied) < SINGULAR).sum() == 1


def test_rounding_on_a_decorative_link_is_not_called_impossible(save, urdf):
    moments = 'ixx="1e-18" iyy="-1e-18" izz="3e-18" ixy="0" ixz="0" iyz="0"'
    dust = f'<inertial><mass value="1e-12"/><inertia {moments}/></inertial>'
    text = pair(urdf, urdf.inertial(2.0, 0.3)).replace('<link name="tip"></link>', urdf.link("tip", dust))
    assert check(save(text)).problems == ()
