"""Outputs of every type, arrays too, are simulated as fmpy does it. Only real scalars can be an actuator's."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmu_fakes import make, repacked

from skillframe.errors import InputError
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import common_folder, compile_library
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.opening import open_actuators
from skillframe.fmu.simulate import simulate_to_csv

pytestmark = pytest.mark.usefixtures("compiler")
VARIABLES = """
    <Float64 name="vector" valueReference="100" causality="output" variability="continuous" initial="calculated"><Dimension start="3"/></Float64>
    <Int32 name="count" valueReference="101" causality="output" variability="discrete" initial="calculated"/>
    <String name="label" valueReference="102" causality="output" variability="discrete" initial="calculated"/>
"""  # noqa: E501
MEMBERS = "".join(f'<Output valueReference="{r}"/>' for r in (100, 101, 102))
UNKNOWNS = "".join(f'<InitialUnknown valueReference="{r}"/>' for r in (100, 101, 102))


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    """The good fake with a vector, an integer and a text among its outputs."""
    folder = tmp_path_factory.mktemp("typed")
    good = make(folder, "good", 3)
    with zipfile.ZipFile(good) as archive:
        archive.extractall(folder / "tree")
        text = archive.read("modelDescription.xml").decode()
        library = next(n for n in archive.namelist() if n.startswith("binaries/"))
    sources = folder / "tree" / "sources"
    (sources / "typed.c").write_text(Path(__file__).with_name("typed_fake.c").read_text())
    compile_library(["typed.c", "good.c"], "typed.so", sources, [f"-I{common_folder()}"])
    text = text.replace("  </ModelVariables>", VARIABLES + "  </ModelVariables>")
    first = text.index("    <InitialUnknown")
    text = text[:first] + MEMBERS + "\n" + text[first:]
    text = text.replace("  </ModelStructure>", UNKNOWNS + "\n  </ModelStructure>")
    new = {"modelDescription.xml": text.encode(), library: (sources / "typed.so").read_bytes()}
    return repacked(good, folder / "typed.fmu", drop=lambda name: name in new, add=new.items())


def test_every_output_gets_its_column_arrays_one_per_element(typed, tmp_path):
    done = simulate_to_csv(str(typed), 0.005, 1e-3, tmp_path / "o.csv")
    assert done.problem == ""
    assert done.columns == ["time", "force", "lag", "vector[1]", "vector[2]", "vector[3]", "count", "label"]
    last = (tmp_path / "o.csv").read_text().splitlines()[-1].split(",")
    assert last[3:] == ["0.005", "1.005", "2.005", "5", "fine"]


def test_the_numbers_are_those_of_fmpy(typed, tmp_path):
    from fmpy import simulate_fmu

    simulate_to_csv(str(typed), 0.005, 1e-3, tmp_path / "o.csv", settings={"command": 0.7})
    ours = np.genfromtxt(tmp_path / "o.csv", delimiter=",", names=True, usecols=range(7))
    theirs = simulate_fmu(
        str(typed), stop_time=0.005, step_size=1e-3, output_interval=1e-3, start_values={"command": 0.7},
        output=["force", "lag", "vector", "count"],
    )  # fmt: skip
    np.testing.assert_array_equal(ours["lag"], theirs["lag"])
    np.testing.assert_allclose(ours["vector2"], theirs["vector"][:, 1], rtol=1e-15)
    np.testing.assert_array_equal(ours["count"], theirs["count"])


@pytest.mark.parametrize(("name", "words"), [("vector", "an array of 3"), ("count", "of type Int32")])
def test_an_actuator_takes_real_scalars_only(typed, name, words):
    assert inspect_fmu(typed).variables["vector"].size == 3
    with pytest.raises(InputError, match=words):
        open_actuators([ActuatorSpec(fmu=str(typed), outputs={"force": name})])
