"""FMUs written by hand from the standard's text: right where they are right, one sentence where they are not."""

from __future__ import annotations

import csv
import json
import math
import re
import time
import zipfile

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.fmu.build import find_compiler
from skillframe.fmu.extract import unpack
from tests.fmu_cache import own_cache  # noqa: F401
from tests.oracle import fmus
from tests.oracle.attacks import processes
from tests.system.foreign_fmus import by_fmpy

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def compiler():
    if find_compiler() is None:
        pytest.skip("no C compiler")


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """(version) -> an FMU, built once."""
    folder = tmp_path_factory.mktemp("lag")
    return {
        version: fmus.pack(
            folder / f"lag{version}.fmu", fmus.describe(version), fmus.library(folder / str(version), version), version
        )
        for version in (2, 3)
    }


@pytest.fixture
def said(capfd):
    """(exit code, stdout, stderr) of `skillframe fmu`. Never more than a sentence, never a child left."""

    def say(*arguments):
        capfd.readouterr()
        code = run(["fmu", *map(str, arguments)])
        out, err = capfd.readouterr()
        assert len(err.strip().splitlines()) <= 1 and len(err) < 700, err
        assert code in (0, 1, 2), err
        return code, out, err

    return say


def simulated(said, path, out, *more, stop=1, step=0.1):
    code, _, err = said("simulate", path, "--stop", stop, "--step", step, "--out", out, *more)
    assert code == 0, err
    with out.open(newline="") as file:
        head, *rows = csv.reader(file)
    return {name: [row[i] for row in rows] for i, name in enumerate(head)}


def numbers(column):
    return np.array([{"True": 1.0, "False": 0.0}.get(x, x) for x in column], dtype=float)


def test_every_kind_of_variable_acts_as_in_the_closed_form_and_as_by_fmpy(said, lag, tmp_path):
    settings = ("u=1.5", "n=3", "shift=-1", "gain=-2", "label=grüße, ja")
    options = [word for setting in settings for word in ("--set", setting)]
    ours = simulated(said, lag[2], tmp_path / "o.csv", *options)
    t = numbers(ours["time"])
    # rounding of ten exact steps
    np.testing.assert_allclose(numbers(ours["y"]), -2 * 0.5 * (1 - np.exp(-3 * t)), rtol=1e-13, atol=1e-15)
    assert ours["echo"] == ["grüße, ja"] * 11 and numbers(ours["count"]).tolist() == list(range(11))
    theirs = by_fmpy(lag[2], {"u": 1.5, "n": 3, "shift": -1, "gain": -2.0, "label": "x"}, stop=1, step=0.1)
    for name, values in theirs.items():
        np.testing.assert_array_equal(numbers(ours[name]), np.array(values, float), err_msg=name)


def test_arrays_aliases_and_wide_integers_of_fmi_3_are_those_of_fmpy(said, lag, tmp_path):
    assert json.loads(said(lag[3], "--json")[1])["problems"] == []  # an alias has no entry of its own
    ours = simulated(said, lag[3], tmp_path / "o.csv", "--set", "u=1", "--set", "w=[1, 2, 0.5]", "--set", "small=-128")
    theirs = by_fmpy(lag[3], {"u": 1.0, "w": [1.0, 2.0, 0.5], "small": -128}, stop=1, step=0.1)
    x = np.array(theirs["x"]).reshape(11, 6)
    for k in range(6):
        np.testing.assert_array_equal(numbers(ours[f"x[{k + 1}]"]), x[:, k])
    assert ours["erstes"] == ours["first"] == ours["x[1]"]
    assert set(ours["large"]) == {str(2**64 - 1)} and set(ours["small_out"]) == {"-128"}
    assert float(ours["x[3]"][-1]) == pytest.approx(1 - math.exp(-0.5), rel=1e-13)  # rounding of ten exact steps


@pytest.mark.parametrize(
    ("version", "setting", "words"),
    [
        (2, "on=maybe", "on: is of type Boolean, got 'maybe'; give true or false"),
        (2, "on=3", "on: is of type Boolean, got 3"),
        (2, "n=1.5", "n: is of type Integer, got 1.5; give a whole number from -2147483648 to 2147483647"),
        (2, "n=99999999999", "got 99999999999; give a whole number"),
        (2, "shift=true", "shift: is of type Integer, got True"),
        (2, "gain=2026-01-01", "gain: is of type Real, got datetime.date"),
        (2, "gain=true", "gain: is of type Real, got True; give a number"),
        (2, "gain=[1, 2]", "gain: holds 1, got 2"),
        (2, "gain=nan", r"gain: is not a number \(NaN\)"),
        (2, "y=1", "unknown parameter or input.*'y' is there as output"),
        (3, "small=300", "small: is of type Int8, got 300; give a whole number from -128 to 127"),
        (3, "w=1", "w: holds 3, got 1"),
    ],
)
def test_a_value_that_its_type_cannot_hold_is_refused_before_anything_is_written(
    said, lag, tmp_path, version, setting, words
):
    out = tmp_path / "o.csv"
    code, _, err = said("simulate", lag[version], "--stop", 1, "--step", 0.1, "--set", setting, "--out", out)
    assert code == 2 and not list(tmp_path.iterdir()), err
    assert re.search(words, err), err


TABLES = {
    "two columns": ("time,u,u\n0,1,2\n", "is the name of two columns"),
    "an integer that is none": ("time,shift\n0,0.5\n", "is of type Integer, got 0.5"),
    "too large an integer": ("time,shift\n0,3e9\n", "is of type Integer, got 3000000000.0"),
    "a truth that is none": ("time,on\n0,2\n", "is of type Boolean, got 2.0; give true or false"),
    "utf-16": ("time,u\n0,1\n".encode("utf-16"), "is not text in UTF-8"),
    "an output": ("time,y\n0,1\n", "'y' is there as output"),
}


@pytest.mark.parametrize("how", TABLES)
def test_a_table_that_cannot_be_meant_is_refused(said, lag, tmp_path, how):
    text, words = TABLES[how]
    table, out = tmp_path / "in.csv", tmp_path / "o.csv"
    table.write_bytes(text if isinstance(text, bytes) else text.encode())
    code, _, err = said("simulate", lag[2], "--stop", 1, "--step", 0.1, "--input", table, "--out", out)
    assert code == 2 and words in err and not out.exists(), err


@pytest.mark.parametrize("text", ["\ufefftime,u\r\n0,1\r\n\r\n", '"time" , "u"\n0 , 1\n\n'])
def test_a_table_out_of_a_spreadsheet_is_read(said, lag, tmp_path, text):
    table = tmp_path / "in.csv"
    table.write_text(text, newline="")
    ours = simulated(said, lag[2], tmp_path / "new" / "o.csv", "--input", table)
    assert float(ours["y"][-1]) == pytest.approx(2 * (1 - math.exp(-1.0)), rel=1e-13)  # rounding of ten exact steps


def test_an_fmu_of_one_step_length_is_not_given_a_shorter_last_step(said, lag, tmp_path):
    path = tmp_path / "even.fmu"
    binary = zipfile.ZipFile(lag[2]).read("binaries/linux64/lag.so")
    fmus.pack(path, fmus.describe(variable="false"), binary)
    code, _, err = said("simulate", path, "--stop", 1, "--step", 0.3, "--out", tmp_path / "o.csv")
    assert code == 2 and "is no whole number of steps of 0.3 s" in err
    assert len(simulated(said, path, tmp_path / "o.csv")["y"]) == 11


def test_odd_names_and_folders_of_resources_come_through(said, tmp_path):
    members = [("resources/sub folder/deep/offset.txt", "10.5"), ("documentation/ä/index.html", "x")]
    description = fmus.describe(out="größe.out[1,2] &quot;a&quot;")
    path = tmp_path / "näme mit space.fmu"
    fmus.pack(path, description, fmus.library(tmp_path / "c", RESOURCE="1"), members=members)
    assert said(path)[0] == 0
    assert simulated(said, path, tmp_path / "o.csv")['größe.out[1,2] "a"'][0] == "10.5"


ENDS = {
    "crash when freed": ("ON_FREE=abort();", r"crashed \(SIGABRT\) while being freed after its last step; 11 rows", 12),
    "hang when ended": ("ON_END=for(;;)sleep(1);", "did not answer within 2 s while being freed after .*; 11 rows", 12),
    "wants to end": ("ON_STEP=if(t>0.45)return fmi2Discard;", "terminated the simulation at 0.5 s; 7 rows", 8),
    "no known signal": ("ON_STEP=raise(40);", r"crashed \(signal 40\)", 2),
    "one row": ("ON_STEP=return fmi2Error;", "failed at 0 s: .*; 1 row is in", 2),
}


@pytest.mark.parametrize("how", ENDS)
def test_however_it_ends_the_rows_are_kept_and_one_sentence_says_when(said, tmp_path, how):
    hook, words, rows = ENDS[how]
    name, _, text = hook.partition("=")
    path = fmus.pack(tmp_path / "ends.fmu", fmus.describe(), fmus.library(tmp_path / "c", **{name: text}))
    out = tmp_path / "o.csv"
    code, _, err = said("simulate", path, "--stop", 1, "--step", 0.1, "--out", out, "--timeout", 2)
    assert code == 1 and re.search(words, err), err
    assert len(out.read_text().splitlines()) == rows


def test_what_an_fmu_starts_ends_with_it(said, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # which everything that is started here knows
    hook = "if(t<0.05){int p=fork();if(p==0)for(;;)sleep(1);m->count=p;}"
    path = fmus.pack(tmp_path / "forks.fmu", fmus.describe(), fmus.library(tmp_path / "c", ON_STEP=hook))
    ours = simulated(said, path, tmp_path / "o.csv")
    assert float(ours["count"][1]) > 1  # it did start a process
    patience = time.monotonic() + 5.0
    while processes(tmp_path):
        assert time.monotonic() < patience
        time.sleep(0.01)


XML = {
    "no version": (lambda text: text.replace('fmiVersion="2.0"', ""), "names no version"),
    "a version to come": (lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="4.0"'), "version: 4.0"),
    "another root": (lambda text: "<robot/>", "names no version"),
    "no guid": (lambda text: text.replace(f'guid="{fmus.GUID}"', ""), "without guid"),
    "no reference": (lambda text: text.replace(' valueReference="2"', "", 1), "'valueReference' is required"),
    "a reference in words": (
        lambda text: text.replace('valueReference="2"', 'valueReference="x"', 1), "'x' is not a valid value"
    ),
    "an index beyond": (lambda text: text.replace('index="2"', 'index="77"'), "is not built as the standard says"),
    "no interface": (lambda text: text.replace("CoSimulation", "Vendor"), "holds no interface that can be run"),
}  # fmt: skip


@pytest.mark.parametrize("how", XML)
def test_a_description_that_is_wrong_is_refused_in_words_for_people(said, tmp_path, how):
    change, words = XML[how]
    path = fmus.pack(tmp_path / "bad.fmu", change(fmus.describe()))
    code, out, err = said(path)
    assert code == (1 if how == "no interface" else 2) and words in out + err, out + err
    assert "NoneType" not in err and "int()" not in err and "list index" not in err


def test_archives_that_cannot_be_unpacked_say_so_and_leave_nothing(said, tmp_path):
    good = fmus.pack(tmp_path / "good.fmu", fmus.describe(), b"x" * 500).read_bytes()
    at = good.find(b"PK\x01\x02")
    locked, unusual = bytearray(good), bytearray(good)
    locked[at + 8] |= 1
    locked[6] |= 1
    unusual[at + 10] = unusual[8] = 97
    damaged = bytearray(good)
    damaged[60:80] = bytes(20)
    for data, words in ((locked, "password"), (unusual, "unusual way"), (damaged, "cannot be unpacked")):
        (tmp_path / "bad.fmu").write_bytes(data)
        code, _, err = said(tmp_path / "bad.fmu")
        assert code == 2 and words in err, err
    long = fmus.pack(tmp_path / "long.fmu", fmus.describe(), members=[("resources/" + "d/" * 3000 + "f", "")])
    code, _, err = said(long)
    assert code == 2 and "holds a name of 6011 characters" in err


@pytest.mark.parametrize("name", ["../../../../etc/hostname", "-fplugin=x.so", "gone.c"])
def test_sources_that_are_not_in_the_fmu_never_reach_the_compiler(said, tmp_path, name):
    listed = fmus.describe(sources=f'<SourceFiles><File name="{name}"/></SourceFiles>')
    path = fmus.pack(tmp_path / "source.fmu", listed, members=[("sources/lag.c", fmus.source())])
    code, _, err = said("build", path)
    assert code == 2 and f"lists the source {name!r}, which is not in its folder sources" in err


def test_sources_of_fmi_3_are_built_with_their_folders_of_headers(said, tmp_path):
    group = (
        '<SourceFile name="lag.c"/><PreprocessorDefinition name="TWICE" value="2"/><IncludeDirectory name="include"/>'
    )
    listed = '<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="lag"><SourceFileSet>'
    listed += f"{group}</SourceFileSet></BuildConfiguration></fmiBuildDescription>"
    code = fmus.source(3).replace("->u = v[at++]", "->u = TWICE * MORE * v[at++]")
    members = [("sources/lag.c", '#include "more.h"\n' + code), ("sources/buildDescription.xml", listed)]
    members += [("sources/include/more.h", "#define MORE 5\n")]
    path = fmus.pack(tmp_path / "source.fmu", fmus.describe(3), members=members)
    code, out, err = said("build", path, "--json")
    assert code == 0, err
    ours = simulated(said, json.loads(out)[0]["path"], tmp_path / "o.csv", "--set", "u=1")
    assert float(ours["first"][-1]) == pytest.approx(10 * (1 - math.exp(-1)), rel=1e-13)  # rounding of ten exact steps


def test_a_model_identifier_that_leads_elsewhere_is_refused(said, tmp_path):
    listed = fmus.describe(sources='<SourceFiles><File name="lag.c"/></SourceFiles>')
    listed = listed.replace('modelIdentifier="lag"', 'modelIdentifier="../../evil"')
    path = fmus.pack(tmp_path / "bad.fmu", listed, members=[("sources/lag.c", fmus.source())])
    for command in ((), ("build",)):
        code, _, err = said(*command, path)
        assert code == 2 and "model identifier '../../evil', which is no name of a file" in err


def test_an_array_without_end_is_refused_before_it_is_simulated(said, lag, tmp_path):
    binary = zipfile.ZipFile(lag[3]).read("binaries/x86_64-linux/lag.so")
    path = fmus.pack(tmp_path / "wide.fmu", fmus.describe(3, columns=2_000_000_000), binary, 3)
    code, _, err = said("simulate", path, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv")
    assert code == 2 and "has outputs of 4000000004 values" in err


def test_a_wide_integer_in_a_table_reaches_the_fmu_to_the_last_digit(said, tmp_path):
    wide = 2**62 + 1  # a double would make it 2**62
    code = (
        fmus.source(3)
        .replace("uint64_t large; } M", "uint64_t large; int64_t given; } M")
        .replace(
            "ACCESS(GetUInt64, uint64_t, case 30: v[at++] = m->large; break;)",
            "ACCESS(GetUInt64, uint64_t, case 30: v[at++] = m->given; break;)\n"
            "ACCESS(SetInt64, const int64_t, case 31: m->given = v[at++]; break;)",
        )
    )
    code = code.replace(re.search(r"\nS? ?fmi3Status fmi3SetInt64\(.*", code)[0], "")
    wired = '<Int64 name="given" valueReference="31" causality="input" start="0"/></ModelVariables>'
    description = fmus.describe(3).replace("</ModelVariables>", wired)
    path = fmus.pack(tmp_path / "wide.fmu", description, fmus.compiled(tmp_path / "c", code), 3)
    table = tmp_path / "in.csv"
    table.write_text(f"time,given\n0,{wide}\n")
    assert simulated(said, path, tmp_path / "o.csv", "--input", table)["large"][-1] == str(wide)


ROWS = {
    2: '<ScalarVariable name="v{0}" valueReference="{1}" causality="local"><Real/></ScalarVariable>',
    3: '<Float64\nvalueReference="{1}" causality="local" name="v{0}"/>',
}


def described(count, version=2):
    """A model description with so many variables more."""
    more = "".join(ROWS[version].format(k, k + 100) for k in range(count))
    return fmus.describe(version).replace("</ModelVariables>", more + "</ModelVariables>")


@pytest.mark.parametrize(("version", "count"), [(2, 600_010), (3, 600_008)])  # its own are 10 and 8
def test_a_description_without_end_is_refused_before_it_is_read(said, tmp_path, version, count):
    path = fmus.pack(tmp_path / "many.fmu", described(600_000, version))
    for words in (
        (path,),
        ("simulate", path, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv"),
        ("build", path),
    ):
        code, _, err = said(*words)
        assert code == 2 and f"describes {count} variables, where 100000 are the most" in err, err


def test_a_large_description_is_read_in_a_child_and_its_names_are_there(said, tmp_path):
    binary = fmus.library(tmp_path / "c")
    path = fmus.pack(tmp_path / "large.fmu", described(20_000), binary)
    assert len(simulated(said, path, tmp_path / "o.csv")["y"]) == 11


def test_a_file_of_zeros_is_refused_and_nothing_stays_in_the_cache(said, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = fmus.pack(tmp_path / "zeros.fmu", fmus.describe(), members=[("resources/0", bytes(300_000_000))])
    for words in ((path,), ("simulate", path, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv")):
        code, _, err = said(*words)
        assert code == 2 and "bytes that unpack to 300000000; do not trust this file" in err, err
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]


@pytest.mark.parametrize("command", ["check", "simulate"])
def test_what_was_unpacked_of_an_fmu_that_does_not_load_is_removed(said, tmp_path, monkeypatch, command):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = fmus.pack(tmp_path / "none.fmu", fmus.describe(), b"no library")
    simulate = ("simulate", path, "--stop", 1, "--step", 0.1, "--out", tmp_path / "o.csv")
    words = (path,) if command == "check" else simulate
    code, out, err = said(*words)
    assert code == 1 and "does not load" in out + err
    assert not [p for p in (tmp_path / "cache").rglob("*") if p.is_file()]
    kept = unpack(path)  # as a campaign does that runs it
    assert said(*words)[0] == 1
    assert (kept / "modelDescription.xml").is_file()
