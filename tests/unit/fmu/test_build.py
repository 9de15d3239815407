"""Building: reproducible, cached, valid, honest about its own faces. The standard's own headers agree with ours."""

import subprocess
import zipfile
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from fmu_fakes import make

from skillframe.errors import InputError, MissingDependency, UnknownName
from skillframe.fmu.build import build_fmu, build_named, built, common_folder, find_compiler, find_fmu, fmu_folders
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.table import read_table, variables_header

pytestmark = pytest.mark.usefixtures("compiler")


def test_fmpy_validate_finds_nothing_in_our_fmus(cylinder):
    assert validate_fmu(str(cylinder.path)) == []


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.slow
def test_two_builds_are_the_same_file_to_the_bit(tmp_path, version):
    folder = fmu_folders()["hydraulic_cylinder"]
    first, second = build_fmu(folder, version), build_fmu(folder, version, out=tmp_path / "f.fmu")
    assert first != second and first.read_bytes() == second.read_bytes()


def test_what_is_built_is_listed_with_its_absolute_path_and_not_built_again():
    rows = build_named("hydraulic_cylinder")
    stamps = [row.path.stat().st_mtime_ns for row in rows]
    assert [row.path.stat().st_mtime_ns for row in build_named("hydraulic_cylinder")] == stamps
    listed = [row for row in built() if row.name == "hydraulic_cylinder"]
    assert [(row.fmi_version, row.path) for row in listed] == [("2.0", rows[0].path), ("3.0", rows[1].path)]
    assert all(row.path.is_absolute() for row in listed)


def test_an_fmu_holds_its_sources_its_readme_and_both_kinds(cylinder):
    names = zipfile.ZipFile(cylinder.path).namelist()
    assert "sources/cylinder.c" in names and "documentation/README.md" in names
    assert cylinder.kinds == ("co_simulation", "model_exchange")
    assert cylinder.has_sources and cylinder.runs_here and cylinder.saves_state and cylinder.variable_step


def test_every_variable_of_the_contract_is_there(cylinder):
    inputs = ["command", "position", "velocity", "acceleration"]
    outputs = ["force", "force_mean", "work", "pressure_a", "pressure_b", "flow_a", "flow_b", "spool"]
    parameters = set(
        "bore rod stroke dead_volume_a dead_volume_b bulk_modulus air_fraction rated_flow rated_pressure_drop"  # noqa: SIM905
        " rated_drop_is_per_edge spool_frequency spool_damping spool_slew deadband hysteresis laminar_pressure leakage"
        " coulomb_friction viscous_friction static_friction presliding_length supply_pressure return_pressure"
        " endstop_stiffness endstop_damping".split()
    )
    assert cylinder.names("input")[:4] == inputs
    assert cylinder.names("output")[:8] == outputs
    assert parameters <= set(cylinder.names("parameter"))
    units = {name: cylinder.variables[name].unit for name in ("bore", "leakage", "supply_pressure", "viscous_friction")}
    assert units == {"bore": "m", "leakage": "m3/(s.Pa)", "supply_pressure": "Pa", "viscous_friction": "N.s/m"}


@pytest.mark.parametrize("version", [2, 3])
def test_our_declarations_are_those_of_the_official_headers(tmp_path, version):
    """The faces compile without a warning against the headers that fmpy ships, and against our own."""
    import fmpy

    folder = fmu_folders()["hydraulic_cylinder"]
    (tmp_path / "variables.h").write_text(variables_header(read_table(folder), "{x}"))
    official = ["-DSTANDARD_HEADERS", f"-I{Path(fmpy.__file__).parent / 'c-code'}"]
    for extra in ([], official):
        command = [
            *find_compiler(), "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *extra,
            "-Wno-unused-const-variable", "-Wno-unused-parameter", f"-I{tmp_path}", f"-I{folder}",
            f"-I{common_folder()}", str(common_folder() / f"face{version}.c"), str(folder / "cylinder.c"),
        ]  # fmt: skip
        result = subprocess.run(command, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr


def test_a_wrong_name_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="did you mean 'hydraulic_cylinder'"):
        find_fmu("hydraulic_cilinder")
    with pytest.raises(InputError, match="no such file"):
        find_fmu("absent.fmu")


def test_a_folder_is_said_to_be_one(tmp_path):
    with pytest.raises(InputError, match="is a folder; give"):
        find_fmu(tmp_path)


def test_without_a_compiler_building_says_what_to_type(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(MissingDependency, match="pip install ziglang"):
        build_fmu(fmu_folders()["hydraulic_cylinder"], 2, out=tmp_path / "f.fmu")


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.slow
def test_a_users_own_fmu_takes_a_table_and_one_c_file(tmp_path, version):
    path = make(tmp_path, "good", version)
    assert validate_fmu(str(path)) == []
    assert inspect_fmu(path).names("output") == ["force", "lag"]


def test_a_table_that_cannot_be_meant_is_refused(tmp_path):
    make(tmp_path, "good")
    table = tmp_path / "good" / "fmu.toml"
    table.write_text(table.read_text().replace("force = { }", 'force = { unit = "n" }'))
    with pytest.raises(InputError, match="unknown unit 'n'"):
        read_table(table.parent)
    table.write_text(table.read_text().replace('"good.c"', '"god.c"').replace('{ unit = "n" }', "{ }"))
    with pytest.raises(InputError, match=r"no file 'god\.c'"):
        read_table(table.parent)
