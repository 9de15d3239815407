"""`skillframe fmu`: the contract's keys, exit codes and one-sentence refusals."""

import json
import tomllib
from pathlib import Path

import pytest

from skillframe.cli.main import run
from skillframe.fmu.build import find_compiler
from tests.fmu_cache import own_cache  # noqa: F401

TABLE = Path(__file__).resolve().parents[3] / "fmus" / "hydraulic_cylinder" / "fmu.toml"
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def said(capsys, *arguments):
    """(exit code, JSON on stdout, stderr)."""
    code = run(["fmu", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, json.loads(out) if out.startswith(("[", "{")) else out, err


@pytest.fixture
def built(capsys):
    code, rows, err = said(capsys, "build", "--json")
    assert code == 0, err
    return {row["fmi_version"]: row["path"] for row in rows if row["name"] == "hydraulic_cylinder"}


def test_build_then_list_gives_a_row_per_built_file_with_an_absolute_path(built, capsys):
    code, rows, err = said(capsys, "--json")
    assert code == 0 and err == ""
    ours = [row for row in rows if row["name"] == "hydraulic_cylinder"]
    assert [set(row) for row in ours] == [{"name", "fmi_version", "path"}] * 2
    assert {row["fmi_version"]: row["path"] for row in ours} == built
    assert all(Path(row["path"]).is_absolute() and Path(row["path"]).is_file() for row in ours)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_check_has_the_keys_of_the_contract_and_finds_nothing(built, capsys, version):
    code, found, _ = said(capsys, built[version], "--json")
    assert code == 0
    assert list(found) == [
        "fmi_version", "kinds", "platforms", "has_sources", "inputs", "outputs", "state_capability", "problems",
            "confinement", "notes",
    ]  # fmt: skip
    assert found["fmi_version"] == version and found["problems"] == [] and found["state_capability"] == "exact"
    assert found["kinds"] == ["co_simulation", "model_exchange"]


def test_check_lists_every_variable_that_can_be_connected_or_set_with_its_unit_and_start_value(built, capsys):
    code, out, _ = said(capsys, built["3.0"])
    lines = {line.split()[0]: line.split() for line in out.partition("variable")[2].splitlines()[1:]}
    assert code == 0
    assert lines["bore"] == ["bore", "parameter", "0.08", "m", "diameter", "of", "the", "piston"]
    assert lines["velocity"][1:4] == ["input", "0.0", "m/s"] and lines["force"][1:3] == ["output", "N"]
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    assert len(lines) == sum(len(table[kind]) for kind in ("input", "output", "parameter"))


def test_simulate_writes_time_and_then_every_output_by_its_name(built, capsys, tmp_path):
    out = tmp_path / "out.csv"
    code, _, err = said(capsys, "simulate", built["2.0"], "--stop", "0.01", "--step", "0.001", "--out", out)
    assert code == 0, err
    lines = out.read_text().splitlines()
    assert lines[0].startswith("time,force,force_mean,work,pressure_a,pressure_b,flow_a,flow_b,spool")
    assert len(lines) == 12
    times = [float(line.split(",")[0]) for line in lines[1:]]
    assert times == pytest.approx([k / 1000 for k in range(11)])


def test_inputs_from_a_table_are_held_and_the_result_is_fmpys_own(built, capsys, tmp_path):
    import numpy as np
    from fmpy import simulate_fmu

    table, out = tmp_path / "in.csv", tmp_path / "out.csv"
    table.write_text("time,command,velocity\n0,0.2,0\n0.005,-0.1,0\n")
    arguments = ("--stop", "0.02", "--step", "0.001", "--input", table, "--out", out)
    assert said(capsys, "simulate", built["3.0"], *arguments)[0] == 0
    ours = np.genfromtxt(out, delimiter=",", names=True)
    signals = np.array([(0, 0.2), (0.005, 0.2), (0.005, -0.1)], dtype=[("time", float), ("command", float)])
    theirs = simulate_fmu(
        built["3.0"], stop_time=0.02, step_size=1e-3, output_interval=1e-3, input=signals, fmi_type="CoSimulation"
    )
    theirs = theirs[np.unique(np.round(theirs["time"], 6), return_index=True)[1]]
    for name in ("pressure_a", "pressure_b", "spool", "force"):
        np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("absent.fmu",), "absent.fmu: no such file"),
        (("hydraulic_cilinder",), "did you mean 'hydraulic_cylinder'?"),
        (("build", "hydraulic_cilinder"), "did you mean 'hydraulic_cylinder'?"),
        (("simulate", "FMU", "--stop", "1", "--step", "0", "--out", "o.csv"), "give 0 < step <= stop"),
        (("simulate", "FMU", "--stop", "1", "--step", "0.1", "--out", "o.csv", "--set", "comand=1"), "'command'?"),
        (("simulate", "FMU", "--stop", "1", "--step", "0.1", "--out", "o.csv", "--input", "no.csv"), "no.csv"),
    ],
)
def test_bad_input_gets_one_sentence_exit_2_and_leaves_no_file(built, capsys, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = said(capsys, *(built["2.0"] if a == "FMU" else a for a in arguments))
    assert code == 2 and words in err and out == ""
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column time"),
        ("time,command\n", "a header and no rows"),
        ("time,command\n0,1\n0,2\n", "line 3: time does not grow"),
        ("time,command\n0,x\n", "line 2: holds something that is no number"),
        ("time,command\n0,nan\n", "finite numbers"),
        ("time,comand\n0,1\n", "did you mean 'command'?"),
        ("time,command\n0,1,2\n", "needs 2 finite numbers"),
    ],
)
def test_a_bad_input_table_is_refused_with_its_line(built, capsys, tmp_path, text, words):
    table = tmp_path / "in.csv"
    table.write_text(text)
    arguments = ("--stop", "1", "--step", "0.1", "--input", table, "--out", tmp_path / "o.csv")
    code, _, err = said(capsys, "simulate", built["2.0"], *arguments)
    assert code == 2 and words in err and not (tmp_path / "o.csv").exists()


def test_a_simulation_that_fails_exits_1_with_its_reason_and_keeps_its_rows(built, capsys, tmp_path):
    table, out = tmp_path / "in.csv", tmp_path / "out.csv"
    table.write_text("time,position\n0,0.3\n0.005,0.9\n")
    arguments = ("--stop", "1", "--step", "0.001", "--input", table, "--out", out)
    code, _, err = said(capsys, "simulate", built["2.0"], *arguments)
    assert code == 1 and "failed at 0.005 s" in err and "position 0.9 m is outside the stroke" in err
    assert len(out.read_text().splitlines()) == 7  # header, start, five steps


def test_a_file_that_is_no_fmu_exits_2(capsys, tmp_path):
    path = tmp_path / "x.fmu"
    path.write_text("not a zip")
    code, _, err = said(capsys, path)
    assert code == 2 and "is not an FMU" in err
