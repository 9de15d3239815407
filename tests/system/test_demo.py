"""The demo, from an empty folder to its report, with few trials."""

import json
from pathlib import Path

import pytest

from skillframe.cli.main import run


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_demo_ends_in_a_report_with_a_certificate_and_tells_how_each_campaign_ended(tmp_path, capsys):
    out = tmp_path / "demo"
    assert run(["demo", "--out", str(out), "--trials", "4", "--rate", "0.5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["report"] == str(out / "report.html") and (out / "report.html").is_file()
    assert [each["world"] for each in told["campaigns"]] == ["valley", "peg_in_hole"]
    assert all(skill["trials"] == 4 for each in told["campaigns"] for skill in each["skills"].values())
    assert len(told["commands"]) == 10 and all(each.startswith("skillframe ") for each in told["commands"])
    assert list((out / "peg" / "demonstrations").iterdir()), "the page shows what was shown"
    assert (out / "proof" / "certificate.json") == Path(told["certificate"])
    found = json.loads(Path(told["certificate"]).read_text())["predicate"]["certified"]
    assert told["certified"] == found  # four looks propose all that is declared, and one claim in ten of that fails
    page = (out / "report.html").read_text()
    links = page.partition("</nav>")[0].partition("<nav")[2]
    assert links.index('href="#certificate">Certificate<') < links.index('href="#c1"')
    assert page.index('id="certificate"') < page.index('class="hero"') and "no requirement" not in page
    assert "sobol" not in page
    assert page.count("Certificate: Valley") == 1 and ("not certified: " in page) != found
    assert run(["certify", "check", str(out / "proof"), "--replays", "1"]) == 0
