"""A machine's cylinders, motor and pump as a system of FMUs, in a second master, and its parameters read back."""

import shutil

import numpy as np
import pytest
from skillframe_hydraulics.checks.figures import completed
from skillframe_papers.rows.crane_runs import MOVING, Follow, blend, scene

from skillframe.cli.main import run
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.files import checkout
from skillframe.fmu.ssp import PARAMETERS
from skillframe.robot.chain import ClosedChain
from skillframe.robot.spec import load_robot
from tests.excavator import write_excavator

EXAMPLE = checkout() / "docs" / "how-to" / "excavator"
PUMP = '\n[supply.main]\nflow = "160 l/min"\nvolume = "20 l"\n'
POST = f'{PUMP}kind = "load_sensing"\ncompensation = "post"\n'
H = 1e-3


def test_parameters_of_a_machine_come_back_to_the_last_bit_and_others_replace_them(tmp_path, compiler, capsys):
    """Of the excavator of the docs, whose cylinders and motor are of data sheets, with units."""
    machine = shutil.copytree(EXAMPLE, tmp_path / "machine")
    assert run(["fmu", "export", str(EXAMPLE), "--out", str(machine / "values.ssp")]) == 0
    assert capsys.readouterr().out.endswith("values.ssp: 5 components, communication step 1 ms\n")
    before, text = load_robot(EXAMPLE), (machine / "robot.toml").read_text(encoding="utf-8")
    described = text.replace('bore = "160 mm"', 'bore = "150 mm"')
    (machine / "robot.toml").write_text(f'parameter_set = "values.ssp"\n{described}', encoding="utf-8")
    assert run(["robots", "--check", str(machine)]) == 0, capsys.readouterr()
    after = load_robot(machine)
    for old, new in zip(before.actuation, after.actuation, strict=True):
        assert new.joint == old.joint
        assert {name: value for name, value in new.parameters.items() if name != "initial_force"} == completed(old)


def test_another_robot_is_refused(capsys, tmp_path):
    assert run(["fmu", "export", "panda", "--out", str(tmp_path / "x.ssp")]) == 2
    said = "error: robot panda: is no hydraulic machine; name one such as hiab_xs031\n"
    assert capsys.readouterr().err == said


class Recording:
    """A bank, and its inputs before and outputs after each step that is not taken back (steps, actuators, columns)."""

    native = None  # the master's steps in C do not pass here

    def __init__(self, bank):
        self.bank, self.given, self.got = bank, [], []

    def __getattr__(self, name):
        return getattr(self.bank, name)

    def step(self, time, step):
        self.given.append(self.bank.u.copy())
        fine = self.bank.step(time, step)
        self.got.append(self.bank.y.copy())
        return fine

    def save(self):
        self.kept = len(self.given)
        self.bank.save()

    def restore(self):
        del self.given[self.kept :], self.got[self.kept :]
        self.bank.restore()


@pytest.mark.slow
@pytest.mark.parametrize("pump", [PUMP, pytest.param(POST, marks=pytest.mark.figures)], ids=["constant", "compensated"])
def test_a_second_master_gives_the_traces_of_a_run_to_a_millionth(tmp_path, compiler, monkeypatch, pump):
    """An excavator with a pump that is too small for its path, in FMPy's master with the inputs that ours gave.

    FMPy gives all inputs one step later, and zeros in the first, in which the machine stands with its valves shut and
    the pistons leak by 1e-16 m3/s per Pa: a millionth of each trace's largest value is far above that.
    """
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssv
    from skillframe_hydraulics import drive

    folder, banks, kept = write_excavator(tmp_path / "excavator"), drive.banks, []
    with (folder / "robot.toml").open("a", encoding="utf-8") as file:
        file.write(pump)
    monkeypatch.setattr(drive, "banks", lambda *a, **k: kept.append(Recording(banks(*a, **k))) or kept[-1])
    robot = load_robot_model(str(folder))
    chain, way = ClosedChain(robot), np.array([0.4, 0.8, -0.4])
    tip = chain.at(chain.minimal(chain.home), np.zeros(4)).data.oMf[chain.robot.tool_frames[0]].translation
    setup = Setup(robot=robot, scene=scene(tip - np.array([5.0, 0.0, 0.0]), plate=False))
    path = Follow(lambda time: (blend(time / 2.0)[0] * way, blend(time / 2.0)[1] / 2.0 * way), MOVING)
    found = simulate(path, setup, {}, [np.random.default_rng(5)], duration_s=1.5, trace_hz=100.0)
    assert found.traces[0].machine["pace"].min() < 0.8  # the pump is full
    bank = kept[0]
    given, got = np.array(bank.given), np.array(bank.got)
    assert run(["fmu", "export", str(folder), "--out", str(tmp_path / "machine.ssp")]) == 0

    def held(actuator, column):
        return lambda time: given[min(round(time / H), len(given) - 1), actuator, column]

    inputs = {
        "main_supply_drop" if name == "supply_drop" else f"{joint}_{name}": held(i, j)
        for i, joint in enumerate(chain.actuated) for j, name in enumerate(bank.inputs)
    }  # fmt: skip
    file = str(tmp_path / "machine.ssp")
    values = read_ssv(file, resource=PARAMETERS)
    second = simulate_ssp(file, 0.0, (len(given) + 0.5) * H, H, values, inputs)[1 : len(given) + 1]
    assert len(second) > 8000
    off = {
        f"{joint}.{name}": np.abs(second[f"{joint}.{name}"] - got[:, i, j]).max() / np.abs(got[:, i, j]).max()
        for i, joint in enumerate(chain.actuated) for j, name in enumerate(bank.outputs)
    }  # fmt: skip
    print(f"largest difference {max(off.values()):.1e} of the largest value: {max(off, key=off.get)}")
    assert max(off.values()) < 1e-6
    assert max(value for name, value in off.items() if "pressure" in name) < 1e-7
