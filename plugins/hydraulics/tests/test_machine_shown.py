"""`skillframe robots NAME` of a hydraulic machine."""

import json

from skillframe.cli.main import run


def test_what_a_joint_does_not_have_is_null_for_scripts(capsys):
    assert run(["robots", "hiab_xs031", "--json"]) == 0
    joints = {j["name"]: j for j in json.loads(capsys.readouterr().out)["joints"]}
    assert joints["lift_barrel_pivot"]["effort"] is None  # without a motor, and without a limit
    assert joints["lift_piston"]["unit"] == "m" and joints["lift_piston"]["effort"] > 0.0


def test_show_says_of_a_machine_what_drives_it_what_it_measures_with_and_its_gains(capsys):
    assert run(["robots", "hiab_xs031", "--json"]) == 0
    machine = json.loads(capsys.readouterr().out)
    assert [drive["velocity_gain"] for drive in machine["actuation"]] == [5e-3, 5e-3, 1e-3]  # published
    assert machine["sensors"] == {"encoder": 1e-4, "pressure": 0.22e5, "corner_hz": 24.0, "watch": True}  # published
    assert len(machine["loops"]) == 2 and machine["payload"]["rating"] == 475.0
    assert run(["robots", "panda", "--json"]) == 0
    assert not {"actuation", "sensors", "gains", "payload"} & json.loads(capsys.readouterr().out).keys()
