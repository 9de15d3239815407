"""Systems of FMUs written as SSP, and parameter values read back with their units."""

import shutil
import zipfile
from pathlib import Path

import pytest
from fmu_fakes import make

from skillframe.errors import SkillframeError
from skillframe.extend.drives import written_out
from skillframe.fmu.ssp import PARAMETERS, Component, write_ssp
from skillframe.fmu.ssv import STRUCTURE, in_unit, read_parameters

CYLINDER = "hydraulic_cylinder"
FIGURES = {"bore": 0.1, "rated_flow": 1 / 3, "feed_check": False}
HEAD = (
    'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
    ' xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="n"'
)
BAR = '<ssc:BaseUnit kg="1" m="-1" s="-2" factor="1e5"/>'


def pair():
    """Two cylinders with an input in common."""
    return [
        Component(
            name=name, fmu=CYLINDER, parameters=FIGURES, start={"position": 0.25},
            inputs={f"{name}_command": "command", "line_supply_drop": "supply_drop"},
            outputs={f"{name}_force": "force"},
        )
        for name in ("boom", "boom_stick")
    ]  # fmt: skip


@pytest.fixture
def written(tmp_path, compiler):
    path = tmp_path / "pair.ssp"
    write_ssp(path, "pair", pair(), 1e-3)
    return path


def ssv(*values, units=""):
    """An .ssv of (name, element) pairs."""
    rows = "".join(f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>' for name, value in values)
    return f"<ssv:ParameterSet {HEAD}><ssv:Parameters>{rows}</ssv:Parameters>{units}</ssv:ParameterSet>"


def real(value, unit=""):
    return f'<ssv:Real value="{value}"' + (f' unit="{unit}"/>' if unit else "/>")


def unit(name, base):
    return f'<ssv:Units><ssc:Unit name="{name}">{base}</ssc:Unit></ssv:Units>'


def taken(folder, content, fmu=CYLINDER, name="values.ssv"):
    """Parameters of a robot.toml's actuator of the joint boom, given its bore, with a parameter set."""
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    drive = {"joint": "boom", "fmu": fmu, "parameters": {"bore": 0.08}}
    return written_out({"actuation": [drive], "parameter_set": name}, folder / "robot.toml")["actuation"][0][
        "parameters"
    ]


def packed(folder, members):
    with zipfile.ZipFile(folder / "made.ssp", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return (folder / "made.ssp").read_bytes()


def ssd(elements="", bindings=""):
    return (
        '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription">'
        f"<ssd:System>{bindings}<ssd:Elements>{elements}</ssd:Elements></ssd:System></ssd:SystemStructureDescription>"
    )


def bound(source, inner="", prefix=""):
    row = f'<ssd:ParameterBinding source="{source}" prefix="{prefix}">{inner}</ssd:ParameterBinding>'
    return f"<ssd:ParameterBindings>{row}</ssd:ParameterBindings>"


def test_what_is_written_is_valid_by_the_schemas_of_ssp_and_repeats_to_the_bit(written, tmp_path):
    from fmpy.ssp.ssd import read_ssd, read_ssv

    system = read_ssd(str(written), validate=True).system
    values = read_ssv(str(written), resource=PARAMETERS, validate=True)
    assert [each.name for each in system.elements] == ["boom", "boom_stick"]
    assert [c.name for c in system.connectors if c.kind == "input"] == [
        "boom_command", "line_supply_drop", "boom_stick_command",
    ]  # fmt: skip
    shared = [c.endElement for c in system.connections if c.startConnector == "line_supply_drop"]
    assert shared == ["boom", "boom_stick"]
    assert {p.name: p.unit for p in values.parameters}["boom.rated_flow"] == "m3/s"
    with zipfile.ZipFile(written) as archive:
        assert archive.namelist() == [STRUCTURE, PARAMETERS, f"resources/{CYLINDER}.fmu"]
    write_ssp(tmp_path / "again.ssp", "pair", pair(), 1e-3)
    assert (tmp_path / "again.ssp").read_bytes() == written.read_bytes()


def test_values_come_back_to_the_last_bit_and_starts_of_inputs_do_not(written, tmp_path):
    with zipfile.ZipFile(written) as archive:
        values = archive.read(PARAMETERS).decode()
    both = [each.name for each in read_parameters(written)]
    assert both == [f"{name}.{own}" for name in ("boom", "boom_stick") for own in (*FIGURES, "position")]
    own = values.replace("boom_stick.", "boom.")
    assert taken(tmp_path, own) == FIGURES


def test_the_units_of_an_fmu_of_another_maker_are_those_of_its_description(tmp_path, cylinder2):
    """A copy, which is read in a process of its own."""
    from fmpy.ssp.ssd import read_ssd

    shutil.copyfile(cylinder2.path, tmp_path / "their.fmu")
    path, one = tmp_path / "one.ssp", {"fmu": "their.fmu", "inputs": {"u": "command"}, "outputs": {"f": "force"}}
    write_ssp(path, "one", [Component(name="boom", parameters={"bore": "90 mm"}, **one)], 1 / 3000, tmp_path)
    assert [unit.name for unit in read_ssd(str(path), validate=True).units] == ["1", "N"]
    with zipfile.ZipFile(path) as archive:
        assert 'stepSize="0.000333333333333"' in archive.read(STRUCTURE).decode()
        assert taken(tmp_path, archive.read(PARAMETERS), "their.fmu") == {"bore": 0.09}
    assert taken(tmp_path, ssv(("boom.bore", real(90, "mm"))), "their.fmu") == {"bore": 0.09}
    with pytest.raises(SkillframeError, match=r"boom\.bore: is in Pa, and its FMU takes m; give it in m"):
        taken(tmp_path, ssv(("boom.bore", real(90, "Pa"))), "their.fmu")


@pytest.mark.parametrize(
    ("name", "value", "units", "expected"),
    [
        ("supply_pressure", real(210, "bar"), "", 210e5),
        ("supply_pressure", real(21, "MPa"), "", 21e6),
        ("supply_pressure", real(3000, "psi"), unit("psi", BAR.replace("1e5", "6894.757")), 3000 * 6894.757),
        ("supply_pressure", real(2, "Pa"), unit("Pa", BAR), 2e5),  # what the file defines prevails
        ("supply_pressure", real(1e7), "", 1e7),
        ("bore", real(125, "mm"), "", 0.125),
        ("rated_flow", real(60, "l/min"), "", 1e-3),
        ("leakage", real(6, "l/min/bar"), "", 1e-9),
        ("viscous_friction", real(2, "kN.s/m"), "", 2e3),
        ("deadband", real(5, "%"), unit("%", '<ssc:BaseUnit factor="0.01"/>'), 0.05),
        ("stroke", '<ssv:Integer value="1"/>', "", 1.0),
        ("feed_check", '<ssv:Boolean value="1"/>', "", True),
    ],
)
def test_a_value_is_converted_to_the_unit_of_the_fmu(tmp_path, name, value, units, expected):
    found = taken(tmp_path, ssv((f"boom.{name}", value), units=units))
    assert found[name] == pytest.approx(expected, rel=1e-14)
    assert type(found[name]) is type(expected)


def test_an_offset_of_a_unit_counts():
    (given,) = read_parameters_of(real(20, "degC"), unit("degC", '<ssc:BaseUnit K="1" offset="273.15"/>'))
    assert in_unit(given, "K", {"K": {"K": 1}}, "here") == pytest.approx(293.15, rel=1e-15)


def read_parameters_of(value, units):
    from skillframe.files.documents import parse_xml
    from skillframe.fmu.ssv import _parameters

    return _parameters(parse_xml(Path("a.ssv"), ssv(("x", value), units=units).encode()), Path("a.ssv"), {})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (ssv(("boom.bore", real(1, "Pa"))), "boom.bore: is in Pa, and its FMU takes m; give it in m"),
        (ssv(("boom.bore", real(1, "bar")), units=unit("bar", BAR)), "boom.bore: is in bar, and its FMU takes m"),
        (ssv(("boom.bore", real(1, "ell"))), "boom.bore: is in 'ell', a unit that the file does not define; give it"),
        (ssv(("boom.bore", real(1, "ell")), units=unit("ell", '<ssc:BaseUnit m="1" factor="0"/>')), "does not define"),
        (ssv(("boom.bor", real(1))), "unknown parameter of hydraulic_cylinder 'bor'; did you mean 'bore'?"),
        (ssv(("bom.bore", real(1))), "unknown component 'bom'; did you mean 'boom'?"),
        (ssv(("boom.force", real(1))), "unknown parameter of hydraulic_cylinder 'force'"),
        (ssv(("boom.bore", real("nan"))), "boom.bore: is <Real> 'nan'; give a finite Real"),
        (ssv(("boom.bore", '<ssv:Binary value="00"/>')), "boom.bore: is <Binary> '00'; give a finite Real"),
        (ssv(("boom.bore", '<ssv:Boolean value="true"/>')), "boom: bore: is of type Real, got True; give a number"),
        (ssv(("boom.feed_check", real(0.5))), "boom: feed_check: is of type Boolean, got 0.5; give true or false"),
        (ssv(("boom.bore", '<ssv:String value="x" unit="bar"/>')), "boom: bore: is of type Real, got 'x'"),
        ("<a/>", "is no parameter set of SSP, but <a>; give an .ssv or .ssp file"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "has a document type (DOCTYPE); remove it"),
        ("<a>", "is not valid XML (no element found)"),
        ("", "is empty; give an SSV file"),
    ],
)  # fmt: skip
def test_a_parameter_set_that_cannot_be_meant_is_refused_with_file_parameter_and_units(tmp_path, content, said):
    with pytest.raises(SkillframeError) as refused:
        taken(tmp_path, content)
    assert str(refused.value).startswith(str(tmp_path / "values.ssv")) and said in str(refused.value)


COMPONENT = '<ssd:Component name="boom" source="resources/a.fmu">{}</ssd:Component>'


def test_of_two_bindings_that_of_the_system_prevails_and_a_prefix_names_the_component(tmp_path):
    members = {
        STRUCTURE: ssd(COMPONENT.format(bound("own.ssv")), bound("all.ssv", prefix="boom.")),
        "own.ssv": ssv(("bore", real(0.2)), ("rod", real(0.1))), "all.ssv": ssv(("bore", real(0.3))),
    }  # fmt: skip
    assert taken(tmp_path, packed(tmp_path, members), name="values.ssp") == {"bore": 0.3, "rod": 0.1}


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"a": ""}, f"holds no {STRUCTURE}; give an .ssp file as a tool exports it"),
        ({STRUCTURE: ssd(bindings=bound("../../etc/passwd"))}, "holds no ../../etc/passwd"),
        ({STRUCTURE: ssd(bindings=bound("a.ssv", "<ssd:ParameterMapping/>"))}, "maps names of parameters (.ssm)"),
        ({STRUCTURE: ssd('<ssd:System name="s"/>')}, "holds systems within its system, which are not read"),
        ({STRUCTURE: "<a/>" + " " * 11_000_000}, "of 11000004 bytes, where 10000000 are the most; do not trust"),
        ({STRUCTURE: '<!DOCTYPE a [<!ENTITY b "c">]><a/>'}, f"{STRUCTURE}: line 1: has a document type"),
        ({STRUCTURE: ssd(bindings=bound("a.ssv")), "a.ssv": "<b/>"}, "a.ssv: is no parameter set of SSP, but <b>"),
    ],
)
def test_an_archive_that_cannot_be_trusted_or_meant_is_refused(tmp_path, members, said):
    with pytest.raises(SkillframeError) as refused:
        taken(tmp_path, packed(tmp_path, members), name="values.ssp")
    assert said in str(refused.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made.ssp", "values.ssp"]  # nothing is unpacked


def test_a_damaged_archive_or_none_is_refused(tmp_path):
    whole = packed(tmp_path, {STRUCTURE: ssd() * 50})
    broken = bytearray(whole)
    broken[60] ^= 0xFF
    for content in (bytes(broken), whole[:40], b"PK"):
        with pytest.raises(SkillframeError, match=r"values\.ssp: is no zip archive that can be read"):
            taken(tmp_path, content, name="values.ssp")
    with pytest.raises(SkillframeError, match=r"none\.ssp: cannot be read \(No such file or directory\)"):
        written_out({"actuation": [], "parameter_set": "none.ssp"}, tmp_path / "robot.toml")


def test_two_fmus_of_one_file_name_are_refused(tmp_path, compiler):
    files = [make(tmp_path / name, "good", 2) for name in "ab" if not (tmp_path / name).mkdir()]
    with pytest.raises(SkillframeError, match="would hold two FMUs of one name"):
        write_ssp(tmp_path / "x.ssp", "x", [Component(name=f.parent.name, fmu=str(f)) for f in files], 1e-3)
