"""Files of a run, and lines of `doctor`, that plug-ins bring; and what is said where the plug-in is not there."""

from itertools import takewhile

import pytest

from skillframe.api.running import SingleRun
from skillframe.cli.doctor import examine
from skillframe.cli.main import run
from skillframe.errors import UnknownName
from skillframe.extend.homes import where_to_get
from skillframe.extend.registry import registry
from tests.report_fakes import trace

OWN = """
    from skillframe import hookimpl
    from skillframe.errors import InputError
    from skillframe.extend import OutputType, RequirementType

    def refuse(path):
        if path.suffix != ".csv":
            raise InputError(path, "is no table", "let it end in .csv")

    def write(trace, path, progress):
        progress(1, 1)
        path.write_text(f"{len(trace.time)} samples")
        return "counted"

    @hookimpl
    def skillframe_outputs():
        yield OutputType(name="count", summary="Number of samples", of="run", check=refuse, write=write)
        yield OutputType(name="other", summary="Of no run", of="scene", write=write)

    @hookimpl
    def skillframe_requirements():
        yield RequirementType(name="a lathe", summary="turning", find=lambda: "", fix=lambda: "buy one")
        yield RequirementType(name="a desk", summary="sitting", find=lambda: "oak", fix=lambda: "never typed")
"""


@pytest.fixture
def own(install, fresh_registry):
    install("own", OWN)


@pytest.mark.usefixtures("own")
def test_an_output_of_a_run_is_an_option_of_run_and_no_other_is(capsys):
    assert run(["run", "--help"]) == 0
    told = capsys.readouterr().out
    assert "--count PATH" in told and "Number of samples." in told
    assert "--other" not in told


@pytest.mark.usefixtures("own")
def test_an_output_refuses_its_file_before_the_run(capsys, tmp_path):
    assert run(["run", "no.json", "--world", "valley", "--count", str(tmp_path / "a.txt")]) == 2
    assert "is no table; let it end in .csv" in capsys.readouterr().err


@pytest.mark.usefixtures("own")
def test_a_run_is_written_by_the_plugin_that_has_the_output(tmp_path):
    seen, done = [], SingleRun(trace=trace(samples=7))
    assert done.write("count", tmp_path / "a.csv", lambda now, total: seen.append((now, total))) == "counted"
    assert (tmp_path / "a.csv").read_text() == "7 samples"
    assert seen == [(1, 1)]
    with pytest.raises(UnknownName, match=r"unknown output of a run 'other' .*count"):
        done.write("other", tmp_path / "a.csv")


@pytest.mark.usefixtures("own")
def test_what_a_plugin_needs_is_a_line_of_doctor():
    rows = {row.name: row for row in takewhile(lambda row: row.name != "browser", examine())}
    assert (rows["a lathe"].found, rows["a lathe"].fix, rows["a lathe"].needed_for) == ("", "buy one", "turning")
    assert (rows["a desk"].found, rows["a desk"].fix) == ("oak", "")


@pytest.fixture
def without_reports(monkeypatch, fresh_registry):
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "worlds")


@pytest.mark.usefixtures("without_reports")
@pytest.mark.parametrize("output", ["replay", "video"])
def test_an_option_of_run_whose_plugin_is_left_out_says_so(capsys, output):
    assert run(["run", "no.json", "--world", "valley", f"--{output}", "a.html"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: unknown output '{output}'") and "SKILLFRAME_PLUGINS leaves out" in told
    assert told.count("\n") == 1


@pytest.mark.usefixtures("without_reports")
@pytest.mark.parametrize("words", [["report", "results", "--out", "a.html"], ["demo", "--out", "demo"]])
def test_what_needs_reports_names_their_distribution_before_it_begins(capsys, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(words) == 2
    assert "report is a command of skillframe-reports, which SKILLFRAME_PLUGINS leaves out" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_every_output_of_reports_has_its_home():
    found = where_to_get("output", "replay", (), ())
    assert found.startswith("replay is in skillframe-reports, which is not installed; type: pip install")
    here = [each.name for each in registry().records("output")] if "reports" in _loaded() else []
    assert all("skillframe-reports" in where_to_get("output", name, (), ()) for name in here)


def _loaded():
    return {plugin.name for plugin in registry().plugins}
