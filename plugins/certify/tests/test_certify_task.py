"""`skillframe certify run TASK.toml` from a simulated teacher to a certificate and its page, trials in closed form."""

import json
from pathlib import Path

import numpy as np
import pytest
from skillframe_certify import procedure

from skillframe.campaign import evaluate
from skillframe.campaign.rows import rows_of
from skillframe.campaign.sampling import draws
from skillframe.campaign.spec import CampaignSpec
from skillframe.cli import main

TASK = """
world = "valley"
robot = "free_tool"
teacher = 2
rate = 0.9
[vary]
"fixture.tilt_y" = { uniform = [-0.4, 0.4] }
"""
TIMED = ("rows.jsonl", "summary.json", "lock", "report.html")
"""Files that tell of times and processes."""


class Trials:
    """Succeed where the valley leans by less than 0.3 rad; the n-th chunk may be interrupted."""

    def __init__(self):
        self.left = float("inf")

    def __call__(self, job):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        spec = CampaignSpec.from_plain(job.spec)
        works = np.abs(draws(spec, job.trials)["fixture.tilt_y"]) < 0.3
        count = len(works)
        return rows_of(spec, job.skill, job.trials, {
            "success": works, "failure": np.where(works, "", "stuck"), "duration_s": np.full(count, 2.0),
            "peak_force_n": np.full(count, 9.0), "final_error_m": np.zeros(count), "final_error_rad": np.zeros(count),
        })  # fmt: skip


def content(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in TIMED
    }


@pytest.fixture
def trials(monkeypatch):
    trials = Trials()
    monkeypatch.setattr(evaluate, "evaluate", trials)
    monkeypatch.setattr(procedure, "draw_entropy", lambda: "e" * 64)  # so that two folders can come out alike
    return trials


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_one_command_leads_to_a_certificate_and_goes_on_after_an_interruption_of_any_step(
    tmp_path, trials, monkeypatch, capsys
):
    typed = main.run

    def certify(folder):  # the skill's file tells the paths that were typed
        (tmp_path / folder).mkdir(exist_ok=True)
        monkeypatch.chdir(tmp_path / folder)
        Path("valley.task.toml").write_text(TASK)
        return typed(["certify", "run", "valley.task.toml", "--out", "out"])

    assert certify("whole") == 0
    said = capsys.readouterr().out
    assert "[7 of 7] $ skillframe report" in said and "\nCertified. Open" in said
    predicate = json.loads((tmp_path / "whole" / "out" / "proof" / "certificate.json").read_text())["predicate"]
    low, high = predicate["box"]["fixture.tilt_y"]
    assert predicate["certified"]
    assert (min(high, 0.3) - max(low, -0.3)) / (high - low) >= 0.9  # the true mean over the box
    assert high - low > 0.4  # of 0.6 that works
    skill = tmp_path / "whole" / "out" / "skill.skill.json"
    kept = skill.read_bytes()
    skill.write_bytes(kept + b"\n")  # repaired, and the command typed again
    assert certify("whole") == 2
    assert "is not the skill that" in capsys.readouterr().err
    skill.write_bytes(kept)
    page = (tmp_path / "whole" / "out" / "report.html").read_text()
    assert page.index("Certificate: valley") < page.index("<h1>")

    def one_step(command):
        typed(command)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(main, "run", one_step)
        assert [certify("stepwise") for _ in range(7)] == [130] * 7
    assert certify("stepwise") == 0
    assert content(tmp_path / "stepwise") == content(tmp_path / "whole")

    codes = []
    while not codes or codes[-1]:  # interrupted in every third chunk that is left
        trials.left = 3
        codes.append(certify("broken"))
    assert len(codes) > 3 and set(codes[:-1]) == {130}
    assert content(tmp_path / "broken") == content(tmp_path / "whole")
