"""A certificate binds what was tested: campaign, files, code, seed; and says what it does not know."""

import json
import re
import shutil
from pathlib import Path

import pytest
from skillframe_certify import procedure
from skillframe_certify.binding import expected, seed_of
from skillframe_certify.certificate import check_certificate, outcome, write_certificate
from skillframe_certify.question import begin, read_question
from skillframe_certify.rounds import looked
from skillframe_worlds.valley import ValleyParams
from test_certify import ENGINE, failed, inside, written

from skillframe.campaign import driver
from skillframe.campaign.folder import campaign_hash, load
from skillframe.campaign.partial_results import status_of
from skillframe.campaign.provenance import code_hash, environment, installed
from skillframe.campaign.runner import Options, run_campaign
from skillframe.campaign.spec import CampaignSpec
from skillframe.errors import InputError

FILE = "campaign.toml"


@pytest.fixture(scope="module")
def looked_at(tmp_path_factory):
    """A folder whose trials to look at have run, and the box that follows from them: both take a second."""
    place = tmp_path_factory.mktemp("looked")
    out = place / "out"
    begin(written(place / "in"), out, ENGINE.describe, ValleyParams, rate=0.95, confidence=0.95)
    procedure.look(out, ENGINE)
    return out, procedure.propose(read_question(out), looked(out, ValleyParams))


@pytest.fixture
def out(looked_at, tmp_path):
    shutil.copytree(looked_at[0], tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture
def claim(looked_at):
    """Writes the next claim of a folder."""

    def write(out, entropy=None):
        return procedure.write_claim(out, read_question(out), looked_at[1], ValleyParams, entropy)

    return write


@pytest.fixture
def through(claim):
    """From the claim to the certificate, as the command goes, but for the entropy, which is chosen."""

    def run(out, engine=ENGINE, entropy="e" * 64):
        if not procedure.claims(out):
            claim(out, entropy)
        procedure.run_fresh(out, procedure.claims(out)[-1], engine)
        return write_certificate(out, outcome(out, ValleyParams), ValleyParams)

    return run


def interrupted(out: Path, through, chunks: int = 0) -> Path:
    """A folder whose claim is written, and whose fresh trials were interrupted after some chunks."""
    left = [chunks]

    def dies(job):
        if CampaignSpec.from_plain(job.spec).vary["fixture.tilt_y"].kind == "uniform":
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
        return inside(job)

    with pytest.raises(KeyboardInterrupt):
        through(out, ENGINE._replace(evaluate=dies, options=Options(traces=0, chunk=64)))
    return out / "claim1" / "fresh"


EDITS = {
    "a setting": (FILE, '"world.slope" = ', '"world.slope" = 0.1 + 0.', None),
    "the skill": ("skills/a.skill.json", "{}", '{"better": true}', "skills/a.skill.json was changed"),
    "the robot": ("robots/box/robot.toml", "urdf = ", "# stronger\nurdf = ", "robots/box/robot.toml was changed"),
    "a choice axis": (FILE, "choice = [0.1, 0.2]", "choice = [0.1, 0.1]", "vary.world.friction is {'choice': "),
    "the duration": (FILE, "duration_s = 20.0", "duration_s = 30.0", "duration_s is 30.0, announced was 20.0"),
    "the seed": (FILE, None, "seed = 1", "seed is 1, announced was "),
    "another file": ("skills/b.skill.json", None, "{}", "skills/b.skill.json was added"),
}


def edit(fresh: Path, file: str, before: str | None, after: str) -> None:
    path = fresh / file
    if file == FILE and before is None:
        path.write_text(re.sub(r"(?m)^seed = \d+$", after, path.read_text()))
    elif before is None:
        path.write_text(after)
    elif after.endswith("0.1 + 0."):
        path.write_text(re.sub(r'(?m)^"world.slope" = .*$', '"world.slope" = 0.5', path.read_text()))
    else:
        assert path.read_text().count(before) == 1
        path.write_text(path.read_text().replace(before, after))


@pytest.mark.parametrize("begun", [0, 2])
@pytest.mark.parametrize("what", EDITS)
def test_what_is_changed_after_the_claim_is_written_is_refused_before_a_trial_runs(out, through, what, begun):
    file, before, after, said = EDITS[what]
    fresh = interrupted(out, through, begun)
    rows = (fresh / "rows.jsonl").read_bytes()
    edit(fresh, file, before, after)
    match = re.escape(said or "set.world.slope is 0.5, announced was ")
    with pytest.raises(InputError, match=f"is not the campaign that claim 1 announced: {match}"):
        through(out)
    assert (fresh / "rows.jsonl").read_bytes() == rows
    assert not (out / "certificate.json").exists()


def test_a_skill_that_is_repaired_where_it_was_looked_at_is_not_what_the_claim_announced(out, through):
    interrupted(out, through)
    (out / "look" / "skills" / "a.skill.json").write_text('{"better": true}')
    with pytest.raises(InputError, match="look: is not as it was when claim 1 was written"):
        through(out)


def test_code_that_was_changed_after_the_claim_is_refused_by_its_name(out, through, monkeypatch):
    interrupted(out, through)
    monkeypatch.setattr(procedure, "installed", lambda: {**installed(), "skillframe code": "f" * 64})
    with pytest.raises(InputError, match=r"with other code: skillframe code was [0-9a-f]{16}, now it is ffff"):
        through(out)


@pytest.mark.slow
def test_code_that_is_changed_while_trials_run_is_noticed_at_their_end(out, through, monkeypatch):
    seen = []

    def changing():
        seen.append(1)
        return {**installed(), **({"skillframe code": "f" * 64} if len(seen) > 1 else {})}

    monkeypatch.setattr(procedure, "installed", changing)
    with pytest.raises(InputError, match="was claimed with other code"):
        through(out)
    assert not (out / "certificate.json").exists()


def test_rows_that_other_code_made_do_not_carry_the_claim(out, through, monkeypatch):
    fresh = interrupted(out, through)
    monkeypatch.setattr(driver, "environment", lambda: {**environment(), "skillframe": "9.9"})
    run_campaign(fresh, inside, Options(traces=0), None, ValleyParams)  # as `campaign resume` does
    with pytest.raises(InputError, match=r"trial 0 ran with other code .*: skillframe was .*, now it is 9\.9"):
        outcome(out, ValleyParams)


def test_the_certificate_names_skillframe_and_plugins_with_versions_and_hashes_and_the_fresh_files(out, through):
    said = through(out)
    names = {each["name"] for each in said["subject"]}
    assert {f"claim1/fresh/{n}" for n in ("campaign.toml", "skills/a.skill.json", "robots/box/robot.toml")} <= names
    core = next(each for each in said["predicate"]["plugins"] if each["name"] == "skillframe")
    assert core["version"] == said["predicate"]["skillframe"] and re.fullmatch("[0-9a-f]{64}", core["sha256"])
    assert said["predicate"]["duration_s"] == 20.0 and "world.friction" in said["predicate"]["other_axes"]


def test_code_is_known_by_its_files_and_a_plugin_by_its_own(install, tmp_path):
    install("one", "x = 1")
    first = environment()
    assert first["dist-one"] == "1.0"
    before = code_hash({"one"})
    assert first["dist-one code"] == before
    (tmp_path / "one.py").write_text("x = 2")
    assert code_hash({"one"}) != before
    assert installed()["dist-one code"] == code_hash({"one"}) != environment()["dist-one code"]
    assert code_hash({"no_such_module_at_all"}) == code_hash(())


def test_nobody_can_know_the_fresh_seed_before_the_claim_is_written(out, claim, tmp_path):
    """The same claim twice: two seeds, each of which follows from the file, and none from the campaign's."""
    shutil.copytree(out, tmp_path / "again")
    claims = [procedure.read_claim(claim(folder)) for folder in (out, tmp_path / "again")]
    assert claims[0]["boxes"] == claims[1]["boxes"]
    assert claims[0]["seed"] != claims[1]["seed"]
    for said in claims:
        assert said["entropy_from"] == "system" and re.fullmatch("[0-9a-f]{64}", said["entropy"])
        assert said["seed"] == seed_of(said) > 1000
        assert seed_of({**said, "rate": 0.9}) != said["seed"]


@pytest.mark.slow
def test_a_certificate_whose_seed_was_chosen_says_so_and_one_whose_seed_was_drawn_does_not(out, through, tmp_path):
    for entropy, word in (("e" * 64, "caller"), (None, "system")):
        shutil.copytree(out, tmp_path / word)
        said = through(tmp_path / word, entropy=entropy)["predicate"]
        assert said["seed_drawn_by"] == word
        assert any("was chosen by the author of the claim" in text for text in said["means"]) == (word == "caller")
        assert any("other folders are not known" in text for text in said["means"])
        assert any("plug-ins are trusted code" in text for text in said["means"])


def test_after_the_last_claim_nobody_is_advised_to_try_another_folder_or_seed(out, claim):
    for _ in range(procedure.MOST_CLAIMS):
        claim(out)
    with pytest.raises(InputError) as raised:
        claim(out)
    assert "another seed" not in str(raised.value) and "would hide that these claims failed" in str(raised.value)


@pytest.mark.slow
def test_the_expected_campaign_is_the_one_that_is_prepared(out, through):
    through(out)
    said = procedure.read_claim(out / "claim1")
    fresh = load(out / "claim1" / "fresh", ValleyParams)
    assert campaign_hash(fresh) == said["campaign"] == campaign_hash(expected(out, said, ValleyParams))


@pytest.mark.slow
def test_a_skill_that_stops_the_campaign_when_it_is_about_to_fail_is_not_judged_by_later_tries_in_silence(out, through):
    """Raises OSError where it would fail, the first time, and succeeds the second."""
    tried = set()

    def sly(job):
        rows = inside(job)
        if CampaignSpec.from_plain(job.spec).vary["fixture.tilt_y"].kind != "uniform":
            return rows
        if job.trials[0] in (52, 156) and job.trials not in tried:
            tried.add(job.trials)
            raise OSError("the cable came loose")
        return rows

    engine = ENGINE._replace(evaluate=sly, options=Options(traces=0, chunk=64))
    for _ in range(2):
        with pytest.raises(driver.CampaignError, match="the cable came loose"):
            through(out, engine)
    said = through(out, engine)["predicate"]
    assert said["ran_again"]["trials"] == 104  # two chunks of 52
    assert said["ran_again"]["why"].endswith("OSError: the cable came loose")
    assert check_certificate(out, ValleyParams) == []
    told = status_of(out / "claim1" / "fresh", ValleyParams)["remarks"]
    assert any(text.startswith("104 trials ran more than once and only their last run is counted") for text in told)


@pytest.mark.slow
def test_a_trial_that_raises_each_time_has_a_row_and_nothing_is_said_to_have_run_again(out, through):
    def raises(job):
        if 5 in job.trials and CampaignSpec.from_plain(job.spec).vary["fixture.tilt_y"].kind == "uniform":
            raise ValueError("no")
        return inside(job)

    said = through(out, ENGINE._replace(evaluate=raises))["predicate"]
    assert 5 in said["failed_trials"] and "ran_again" not in said


@pytest.mark.slow
def test_a_claim_that_failed_is_not_forgotten_by_the_certificate_of_the_next(out, claim, through):
    unkind = ENGINE._replace(evaluate=lambda job: [
        failed(row) if CampaignSpec.from_plain(job.spec).seed != 7 and row["trial"] % 10 == 0 else row
        for row in inside(job)
    ])  # fmt: skip
    assert not through(out, unkind)["predicate"]["certified"]
    claim(out)
    assert not (out / "certificate.json").exists()
    said = through(out)["predicate"]
    assert (said["claim"], said["alpha_spent"]) == (2, pytest.approx(0.075))


@pytest.mark.slow
def test_an_older_claim_or_certificate_is_refused_in_a_sentence(out, through):
    through(out)
    for file, key, value in (("certificate.json", "predicateType", "skillframe.certificate/v1"),
                             ("claim1/claim.json", "version", 1)):  # fmt: skip
        kept = (out / file).read_text()
        (out / file).write_text(json.dumps({**json.loads(kept), key: value}))
        with pytest.raises(InputError, match="was made by an earlier skillframe"):
            check_certificate(out, ValleyParams) if key == "predicateType" else procedure.read_claim(out / "claim1")
        (out / file).write_text(kept)
