"""FMUs as other makers' programs write them: prefixes, Windows' separators, long descriptions, short lists."""

import json
import re
import zipfile

import pytest
from fmu_fakes import make, repacked

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.fmu import inspection
from skillframe.fmu.check import build_from_sources, check_fmu
from skillframe.fmu.child import ChildLost
from skillframe.fmu.extract import member_names, unpack
from skillframe.fmu.inspection import inspect_fmu, problems_of

pytestmark = pytest.mark.usefixtures("compiler", "own_cache")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("makers")
    return {version: make(folder, "good", version) for version in (2, 3)}


def changed(path, out, text):
    """A copy with its description changed."""
    with zipfile.ZipFile(path) as archive:
        old = archive.read("modelDescription.xml").decode()
    return repacked(
        path, out, drop=lambda name: name == "modelDescription.xml", add=[("modelDescription.xml", text(old))]
    )


def prefixed(path, out, version, prefix="Prefix_"):
    """A copy without binaries, whose sources name every function of the interface with a prefix."""
    with zipfile.ZipFile(path) as archive:
        sources = {n: archive.read(n).decode() for n in archive.namelist() if re.match(r"sources/\w+\.[ch]$", n)}
    named = rf"(?<![\w.>])(fmi{version}[A-Z]\w*)(?=\()"
    sources = {name: re.sub(named, rf"{prefix}\1", text) for name, text in sources.items()}
    drop = lambda name: name in sources or name.startswith("binaries/")  # noqa: E731
    return repacked(path, out, drop=drop, add=list(sources.items()))


@pytest.mark.parametrize("version", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_sources_whose_functions_have_a_prefix_build_and_load(good, tmp_path, version):
    made = build_from_sources(prefixed(good[version], tmp_path / "p.fmu", version))
    found = check_fmu(made.path)
    assert found["problems"] == [] and found["state_capability"] == "exact"


@pytest.mark.slow
def test_what_was_built_and_does_not_load_is_said_while_it_is_built(good, tmp_path):
    with zipfile.ZipFile(good[2]) as archive:
        face = archive.read("sources/face2.c").decode()
    broken = face + "\nextern void nobody_has_this(void);\nvoid call(void);\nvoid call(void) { nobody_has_this(); }\n"
    broken += "void *volatile kept = (void *)nobody_has_this;\n"
    drop = lambda name: name == "sources/face2.c" or name.startswith("binaries/")  # noqa: E731
    path = repacked(good[2], tmp_path / "b.fmu", drop=drop, add=[("sources/face2.c", broken)])
    with pytest.raises(InputError, match=r"was built, and .* does not load: .*undefined symbol: nobody_has_this"):
        build_from_sources(path)


@pytest.mark.slow
def test_build_puts_copies_where_it_is_told(good, tmp_path, capsys):
    assert run(["fmu", "build", str(good[2]), "--out", str(tmp_path / "made"), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["path"] == str(tmp_path / "made" / "good2_fmi2.fmu")
    assert check_fmu(tmp_path / "made" / "good2_fmi2.fmu")["problems"] == []


def test_a_zip_with_backslashes_is_read_as_one_with_slashes(good, tmp_path):
    """Python's writer makes slashes of them, so that they are put in behind its back."""
    with zipfile.ZipFile(good[2]) as archive:
        names = [name for name in archive.namelist() if "/" in name]
    content = good[2].read_bytes()
    for name in names:
        content = content.replace(name.encode(), name.replace("/", "\\").encode())
    path = tmp_path / "windows.fmu"
    path.write_bytes(content)
    assert member_names(path) == member_names(good[2])
    assert check_fmu(path)["problems"] == []
    assert (unpack(path) / names[0]).is_file()


@pytest.mark.parametrize("name", ["..\\evil", "\\evil", "C:\\evil", "a\\..\\..\\evil"])
def test_a_backslash_leads_outside_no_more_than_a_slash(good, tmp_path, name):
    path = repacked(good[2], tmp_path / "evil.fmu", add=[("EVIL" + "x" * (len(name) - 4), b"x")])
    path.write_bytes(path.read_bytes().replace(("EVIL" + "x" * (len(name) - 4)).encode(), name.encode()))
    with pytest.raises(InputError, match="which would be written outside its folder"):
        member_names(path)


def test_initial_unknowns_that_a_tool_lists_short_are_a_note_of_an_fmu_that_runs(good, tmp_path):
    def short(text):
        start, end = text.index("<InitialUnknowns>"), text.index("</InitialUnknowns>")
        return text[:start] + text[end + len("</InitialUnknowns>") :]

    found = check_fmu(changed(good[2], tmp_path / "short.fmu", short))
    assert found["problems"] == []
    assert [note.startswith("ModelStructure/InitialUnknowns") for note in found["notes"]] == [True]


def many(text, count=40_000):
    rows = "".join(
        f'<ScalarVariable name="v{i}" valueReference="{10**6 + i}" causality="local"><Real/></ScalarVariable>'
        for i in range(count)
    )
    return text.replace("</ModelVariables>", rows + "</ModelVariables>")


@pytest.mark.slow
def test_a_description_is_given_processor_time_and_validation_may_be_cut_off(good, tmp_path, monkeypatch):
    """Linux counts whole seconds, and a second is the limit: far less than these take to validate, and to read."""
    path = changed(good[2], tmp_path / "many.fmu", many)
    facts = inspect_fmu(path)
    assert len(facts.names("output")) == 2
    monkeypatch.setattr(inspection, "READING_S", 0)
    problems, why = problems_of(path)
    assert problems == [] and "took more processor time than it may while its description was read" in why
    monkeypatch.setattr("skillframe.fmu.check.inspect_fmu", lambda path: facts)
    found = check_fmu(path)
    assert found["problems"] == [] and found["notes"][0].startswith("not validated: ")
    more = changed(good[2], tmp_path / "more.fmu", lambda text: many(text, 99_000))
    with pytest.raises(ChildLost, match="processor time"):
        inspection._asked(more, b"i")


def test_a_busy_machine_does_not_shorten_what_a_description_is_given():
    assert inspection.WAITING_S >= 10 * inspection.READING_S
