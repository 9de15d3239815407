"""What docs/how-to/own-robot.md and own-crane.md show is loaded, checked and run."""

import re
import shutil
import tomllib
import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from skillframe_hydraulics.declared import Gains, MachineNoise
from skillframe_hydraulics.law.vdc_actuator import CYLINDER, cylinders

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend.drives import audit
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from skillframe.robot.tables import Actuation

DOCS = Path(__file__).resolve().parents[2] / "docs" / "how-to"
CRANE, ROBOT = ((DOCS / f"own-{name}.md").read_text(encoding="utf-8") for name in ("crane", "robot"))


def block(page, language, word=""):
    return next(b for b in re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL) if word in b)


@pytest.fixture
def crane(tmp_path):
    """The shipped crane with the page's blocks, the named ones, in the place of its own."""

    def crane_with(*words):
        folder = tmp_path / "my_crane"
        shutil.copytree(robot_names()["hiab_xs031"], folder)
        text = (folder / "robot.toml").read_text(encoding="utf-8")
        for word in words:
            shown = block(CRANE, "toml", word)
            first, key = shown.splitlines()[0], shown.splitlines()[1].partition("#")[0].strip()
            line = re.escape(key) if first.startswith("[[") else ""
            place = re.compile(rf"^{re.escape(first)}\n{line}.*?(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
            text, count = place.subn(shown.rstrip(), text, count=1)
            assert count == 1, first
        (folder / "robot.toml").write_text(text, encoding="utf-8")
        return load_robot(folder)

    return crane_with


def test_the_blocks_of_the_crane_page_make_a_crane_with_nothing_to_warn_of(crane):
    spec = crane('fmu = "hydraulic_cylinder"', "[payload]", "[limits]")
    assert [p for p in audit(spec).problems if p.severity != "info"] == []
    mine, shipped = (cylinders(robot.actuation) for robot in (spec, load_robot("hiab_xs031")))
    for name in CYLINDER:  # the page rounds the flow to 1.67e-3 m3/s, by 0.2 %
        np.testing.assert_allclose(getattr(mine, name), getattr(shipped, name), rtol=3e-3)
    assert mine.counterbalance is shipped.counterbalance is None


def test_each_figure_that_the_page_gives_is_one_that_the_controller_needs():
    shown = tomllib.loads(block(CRANE, "toml", 'fmu = "hydraulic_cylinder"'))["actuation"][0]["parameters"]
    assert shown.pop("static_friction") == shown["coulomb_friction"]  # it may be left out, and is then this
    assert len(shown) == 13  # "all thirteen" says the page
    for name in shown:
        rest = {key: value for key, value in shown.items() if key != name}
        with pytest.raises(InputError, match=f"has no {name}"):
            cylinders([Actuation(joint="lift_piston", fmu="hydraulic_cylinder", parameters=rest)])


def test_the_tables_of_sensors_and_gains_show_the_defaults():
    shown = tomllib.loads(block(CRANE, "toml", "[sensors]") + block(CRANE, "toml", "[gains]"))
    assert (MachineNoise(**shown["sensors"]), Gains(**shown["gains"])) == (MachineNoise(), Gains())


@pytest.mark.slow
def test_the_system_of_fmus_of_the_crane_page_runs_and_its_parameters_come_back(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(re.search(r"^skillframe (fmu export .*)", CRANE, re.MULTILINE)[1].split()) == 0
    exec(compile(block(CRANE, "python", "simulate_ssp"), "own-crane.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()[-1]
    assert f"prints `{printed}`" in CRANE
    folder = tmp_path / "my_crane"
    shutil.copytree(robot_names()["hiab_xs031"], folder)
    robot = folder / "robot.toml"
    robot.write_text(block(CRANE, "toml", "parameter_set") + robot.read_text(encoding="utf-8"), encoding="utf-8")
    with zipfile.ZipFile("crane.ssp") as archive:
        values = archive.read("resources/parameters.ssv").decode()
    own = folder / "crane.ssv"
    own.write_text(values.replace('"19000000.0" unit="Pa"', '"180" unit="bar"'))
    assert [each.parameters["supply_pressure"] for each in load_robot(folder).actuation] == [180e5] * 3
    own.write_text(values.replace('"19000000.0" unit="Pa"', '"180" unit="m"'))
    assert run(["robots", "my_crane/"]) == 2
    assert f"```\n{capsys.readouterr().err.replace(f'{tmp_path}/', '')}```" in CRANE


def test_the_python_of_the_crane_page_runs(capsys):
    names = {}
    exec(compile(block(CRANE, "python"), "own-crane.md", "exec"), names)
    said = capsys.readouterr().out.splitlines()
    assert said[:2] == ["('lift', 'tilt', 'extension')", "[]"]
    assert "'lift_piston':" in said[-1] and "'extension':" in said[-1]


def test_the_robot_toml_and_the_python_of_the_robot_page_run(tmp_path, capsys):
    limits = '<limit lower="-3" upper="3" effort="50" velocity="2"/>'
    moments = '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><origin xyz="0 0 0.1"/><mass value="2"/>{moments}</inertial>'
    links = ["base", *(f"link{i}" for i in range(1, 7)), "flange"]
    text = "".join(f'<link name="{name}">{"" if name == "base" else inertial}</link>' for name in links)
    for i, (parent, child) in enumerate(pairwise(links), 1):
        axis = '<axis xyz="0 0 1"/>' if i % 2 else '<axis xyz="0 1 0"/>'
        text += f'<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        text += f'<origin xyz="0 0 0.2"/>{axis}{limits}</joint>'
    (tmp_path / "my_arm.urdf").write_text(f'<robot name="my_arm">{text}</robot>', encoding="utf-8")
    (tmp_path / "robot.toml").write_text(block(ROBOT, "toml", "my_arm.urdf"), encoding="utf-8")
    robot = load_model(load_robot(tmp_path))
    assert audit(robot).usable and robot.home[3] == -1.8
    exec(compile(block(ROBOT, "python"), "own-robot.md", "exec"), {})
    assert capsys.readouterr().out == "True\n"


def test_the_blocks_on_joints_and_encoders_are_read_with_the_figures_that_they_show(tmp_path):
    folder = tmp_path / "my_arm"
    shutil.copytree(robot_names()["panda"], folder)
    text = (folder / "robot.toml").read_text(encoding="utf-8").replace("[control]\nrate_hz = 1000\n", "")
    shown = [block(ROBOT, "toml", word) for word in ("[dynamics]", "[encoders]")]
    (folder / "robot.toml").write_text("\n".join([text, *shown]), encoding="utf-8")
    model = load_model(load_robot(folder))
    assert (model.model.friction[0], model.model.damping[0]) == (0.2, 0.1)
    assert (model.spec.encoders.bits, model.spec.encoders.step_m, model.spec.control.delay_s) == (17, 1e-6, 0.001)
    assert not model.spec.dynamics.compensate
