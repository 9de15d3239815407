"""`skillframe robots`: exit codes, JSON alone on stdout, and text for people."""

import json

import pytest

from skillframe.cli.main import run

HONEST = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="{mass}"/>
<inertia ixx="{moment}" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><sphere radius="0.3"/></geometry></visual></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
<limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"""


@pytest.fixture
def check(tmp_path, capsys):
    """Run `robots --check --json` on a text. Returns exit code, JSON and what stderr says."""

    def run_check(text):
        path = tmp_path / "r.urdf"
        path.write_text(text, encoding="utf-8")
        code = run(["robots", "--check", str(path), "--json"])
        shown = capsys.readouterr()
        return code, json.loads(shown.out), shown.err

    return run_check


def test_check_says_0_usable_1_not_usable_2_does_not_load(check):
    assert check(HONEST.format(mass=1, moment=0.01))[0] == 0
    assert check(HONEST.format(mass=1, moment=0.05))[0] == 1  # against the triangle inequality
    assert check("<robot")[0] == 2


def test_the_json_of_check_holds_what_the_contract_names(check):
    _, good, _ = check(HONEST.format(mass=2.5, moment=0.01))
    assert good == {"usable": True, "nq": 1, "nv": 1, "mass_kg": 2.5, "problems": []}
    code, bad, _ = check(HONEST.format(mass=1, moment=0.05))
    assert (code, bad["usable"]) == (1, False)
    assert set(bad["problems"][0]) == {"code", "severity", "where", "message", "fix", "figures"}
    assert bad["problems"][0]["severity"] == "fatal"


def test_what_does_not_load_is_json_on_stdout_and_one_sentence_on_stderr(check):
    code, answer, said = check("<robot name='r'/>")
    assert (code, answer["usable"], answer["nq"]) == (2, False, None)
    assert answer["problems"][0]["code"] == "does_not_load"
    assert said.startswith("error: ")
    assert len(said.strip().splitlines()) == 1


def test_the_text_of_check_gives_the_cure(tmp_path, capsys):
    (tmp_path / "r.urdf").write_text(HONEST.format(mass=1, moment=0.05))
    assert run(["robots", "--check", str(tmp_path / "r.urdf")]) == 1
    shown = capsys.readouterr().out
    assert "NOT usable" in shown
    assert "[inertia]" in shown


def test_list_names_the_shipped_robots(capsys):
    assert run(["robots", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {"free_tool", "panda"} <= {row["name"] for row in rows}
    assert run(["robots"]) == 0
    assert "Franka" in capsys.readouterr().out


def test_list_names_a_broken_robot_with_its_error_and_shows_the_rest(tmp_path, capsys, monkeypatch):
    (tmp_path / "robots" / "mine").mkdir(parents=True)
    (tmp_path / "robots" / "mine" / "robot.toml").write_text('urdf = "gone.urdf"')
    monkeypatch.setenv("SKILLFRAME_PATH", str(tmp_path))
    assert run(["robots", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert "gone.urdf" in rows["mine"]["error"]
    assert rows["panda"]["error"] is None


@pytest.mark.parametrize("name", ["panda", "free_tool"])
def test_show_tells_joints_home_and_tool(name, capsys):
    assert run(["robots", name]) == 0
    shown = capsys.readouterr().out
    assert "arm 'arm'" in shown
    assert "fixture at" in shown


def test_show_tells_continuous_follower_and_unlimited_joints(tmp_path, capsys):
    joints = "".join(
        f'<link name="l{i}"/><joint name="{name}" type="{kind}"><parent link="b"/><child link="l{i}"/>{inside}</joint>'
        for i, (name, kind, inside) in enumerate(
            [
                ("a", "revolute", ""),
                ("c", "continuous", ""),
                ("d", "revolute", '<mimic joint="a"/>'),
                ("f", "floating", ""),
            ]
        )
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="b"/>{joints}</robot>')
    assert run(["robots", str(tmp_path / "r.urdf")]) == 0
    shown = capsys.readouterr().out
    assert "free" in shown
    assert "follows another" in shown
    assert "6 freedoms" in shown


def test_an_unknown_robot_gets_a_suggestion_and_exit_code_2(capsys):
    for more in ((), ("--check",)):
        assert run(["robots", "pand", *more]) == 2
        assert "did you mean 'panda'" in capsys.readouterr().err


def test_show_says_the_same_to_people_and_scripts(capsys):
    assert run(["robots", "panda"]) == 0
    words = capsys.readouterr().out
    assert run(["robots", "panda", "--json"]) == 0
    robot = json.loads(capsys.readouterr().out)
    assert [j["name"] for j in robot["joints"]] == [f"joint{i}" for i in range(1, 8)]
    assert all(f"{j['home']:.4f} {j['unit']}" in words for j in robot["joints"])
    assert (robot["nq"], robot["nv"], robot["arms"][0]["tool_frame"]) == (7, 7, "flange")
    assert abs(sum(x * x for x in robot["arms"][0]["home_quaternion_xyzw"]) - 1.0) < 1e-12  # rounding
