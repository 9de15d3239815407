"""Certificates and claims out of shape: each is refused or does not fit, in a sentence, without a traceback."""

import copy
import functools
import json
import random

import pytest
from skillframe_certify import certificate, procedure
from skillframe_certify.binding import seed_of
from skillframe_certify.certificate import check_certificate
from skillframe_certify.certificate import statement as certificate_of
from skillframe_certify.question import read_question
from skillframe_certify.report.answers import read_asked
from skillframe_certify.report.first_page import certificate_page, stand
from skillframe_reports.sources import Chapter
from skillframe_worlds.valley import ValleyParams
from test_certify import ENGINE, asked, through

from skillframe.cli.main import run
from skillframe.errors import InputError, SkillframeError

CERTIFICATE, CLAIM = "certificate.json", "claim1/claim.json"
ODD = (
    None, True, -1, 0, 3, 1e300, float("inf"), float("nan"), 10**17, "", "x", "0.95", "../../etc/passwd", "/etc/passwd",
    "a\0b", "C:\\x", [], [[]], {}, [None], {"x": None}, [[[[1]]]], {"sha256": 5}, "\N{SNOWMAN}" * 300,
)  # fmt: skip


@pytest.fixture
def out(certified):
    return certified


def places(value, at=()):
    """The way to everything inside a document."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inner:
        yield (*at, key)
        yield from places(each, (*at, key))


def mutated(content, rng):
    """A copy with one thing gone, doubled, added or replaced by something odd."""
    made = copy.deepcopy(content)
    way = rng.choice(list(places(made)))
    holder = made
    for key in way[:-1]:
        holder = holder[key]
    kind = rng.choice(("gone", "odd", "odd", "odd", "negative", "huge", "nested", "extra"))
    old = holder[way[-1]]
    if kind == "gone":
        del holder[way[-1]]
    elif kind == "extra" and isinstance(old, dict):
        old["more"] = rng.choice(ODD)
    elif kind == "negative" and type(old) in (int, float):
        holder[way[-1]] = -old - 1
    elif kind == "huge" and type(old) in (int, float):
        holder[way[-1]] = type(old)(1e18)
    elif kind == "nested":
        holder[way[-1]] = [old, [old]]
    else:
        holder[way[-1]] = rng.choice([each for each in ODD if each is not old])
    return made


@pytest.mark.parametrize("file", [CERTIFICATE, CLAIM])
@pytest.mark.slow
def test_three_hundred_malformed_certificates_and_claims_are_each_refused_in_one_sentence(out, file, monkeypatch):
    """150 of each; every other claim with the seed that follows from it, so that its values are looked at too."""
    path, rng = out / file, random.Random(38)
    content = json.loads(path.read_text())
    if file == CERTIFICATE:  # what follows from the trials is the same each time
        found = certificate.outcome(out, ValleyParams)
        compute = functools.cache(lambda rounds, told: certificate_of(out, found, ValleyParams, rounds, told))
        monkeypatch.setattr(certificate, "outcome", lambda *_: found)
        monkeypatch.setattr(certificate, "_tables", lambda *_: [])
        monkeypatch.setattr(certificate, "statement", lambda folder, found, params, rounds, told: compute(rounds, told))
    for number in range(150):
        made = mutated(content, rng)
        if file == CLAIM and number % 2 and isinstance(made, dict):
            made["seed"] = seed_of(made)
        text = json.dumps(made)
        if made == content:  # its seed was mutated, and made again
            continue
        path.write_text(text)
        said = sentences(out, file)
        assert said and all("\n" not in each for each in said), f"is taken for sound: {text[:400]}"
        if number % 10 == 0:
            assert "\n" not in on_the_page(out)


def sentences(out, file):
    """What `check` and `certify` have to say."""
    try:
        return [] if file == CLAIM and certificate.outcome(out, ValleyParams) else check_certificate(out, ValleyParams)
    except SkillframeError as error:
        return [str(error)]


@pytest.mark.parametrize("ends", [(float("inf"), 0.0), (-1e308, 1e308), (1.7e308, 1.71e308), (0.1, 0.1)])
def test_a_claim_of_a_box_without_end_or_volume_is_refused_though_its_seed_follows_from_it(out, ends):
    made = json.loads((out / CLAIM).read_text())
    name = next(iter(made["boxes"][-1]))
    made["boxes"][-1][name] = list(ends)
    (out / CLAIM).write_text(json.dumps(made | {"seed": seed_of(made)}))
    (said,) = sentences(out, CLAIM)
    assert said.startswith(f"{out / CLAIM}: claims {name} from ") and "which is no range; start again" in said


def on_the_page(out):
    """What the page has to say, which does not certify."""
    try:
        found = stand(read_asked(out))
    except InputError as error:
        return str(error)
    return found.why if found.word == "fail" else "\n"


@pytest.mark.needs_plugins
@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("[]", 2, "is no certificate"),
        ("{}", 2, "is no certificate"),
        ('{"predicateType": "skillframe.certificate/v2"}', 2, "missing _type, subject, predicate"),
        ("null", 2, "is no certificate"),
    ],
)
def test_check_and_report_say_in_a_sentence_what_a_certificate_lacks(out, capsys, tmp_path, text, code, said):
    (out / CERTIFICATE).write_text(text)
    for command in (["certify", "check", str(out)], ["report", str(out), "--out", str(tmp_path / "page.html")]):
        assert run(command) == code
        assert said in capsys.readouterr().err


def changed(out, change):
    content = json.loads((out / CERTIFICATE).read_text())
    change(content)
    (out / CERTIFICATE).write_text(json.dumps(content))


@pytest.mark.parametrize("name", ["/etc/hostname", "../out/question.json", "look/../question.json", "C:/x", "\\\\a\\b"])
def test_a_certificate_that_names_a_file_outside_its_folder_is_refused(out, name):
    changed(out, lambda content: content["subject"][0].update(name=name))
    with pytest.raises(InputError, match="which is no file of its folder"):
        check_certificate(out, ValleyParams)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c.update(subject=[]), "leaves out claim1/claim.json"),
        (lambda c: c["subject"].pop(), "leaves out claim1/fresh/results.csv"),
        (lambda c: c["subject"].append(c["subject"][0]), "names a file twice"),
        (lambda c: c["predicate"].update(skillframe="99.0"), "do not follow from the trials: skillframe"),
        (lambda c: c["predicate"].update(skillframe="any text"), "do not follow from the trials: skillframe"),
        (lambda c: c["predicate"].update(plugins=[]), "do not follow from the trials: plugins"),
        (lambda c: c["predicate"].update(duration_s=1.0), "do not follow from the trials: duration_s"),
        (lambda c: c["predicate"].update(certified=1), "do not follow from the trials: certified"),
        (lambda c: c["predicate"].update(more="x"), "do not follow from the trials: more"),
    ],
)
@pytest.mark.slow
def test_what_a_certificate_says_is_computed_again_and_compared(out, change, said):
    changed(out, change)
    assert any(said in text for text in check_certificate(out, ValleyParams))


@pytest.mark.slow
def test_a_table_that_does_not_follow_from_its_rows_is_found_though_its_hash_is_the_certificates(out):
    from skillframe.campaign.provenance import file_hash

    path = out / "claim1" / "fresh" / "results.csv"
    path.write_text(path.read_text().replace(",2.0,", ",1.0,", 1))

    def hashed(content):
        one = next(each for each in content["subject"] if each["name"] == "claim1/fresh/results.csv")
        one["digest"]["sha256"] = file_hash(path)

    changed(out, hashed)
    assert check_certificate(out, ValleyParams) == ["claim1/fresh/results.csv does not follow from the rows beside it"]


def test_a_folder_whose_name_only_begins_like_a_claims_is_none(out):
    (out / "claim1 (copy)").mkdir()
    (out / "claim1 (copy)" / "claim.json").write_text("{}")
    assert check_certificate(out, ValleyParams) == []


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c["predicate"].update(rate=0.999, confidence=0.999),
        lambda c: c["predicate"]["tested"][-1].update(trials=9999, failures=0),
        lambda c: c["predicate"].update(box={"fixture.tilt_y": [-3.0, 3.0]}),
    ],
)
@pytest.mark.slow
def test_a_page_says_in_red_that_an_edited_certificate_does_not_follow_from_its_trials(out, change):
    assert ">certified</p>" in certificate_page(Chapter(name="Peg", content=read_asked(out)))
    changed(out, change)
    text = certificate_page(Chapter(name="Peg", content=read_asked(out)))
    assert 'class="verdict fail"' in text and "does not hold</p>" in text and "certificate.json does not follow" in text
    assert ">certified</p>" not in text and "9999" not in text and "99.9 %" not in text and "Signed:" not in text


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_report_exits_with_one_where_a_certificate_does_not_follow_from_its_trials(out, capsys, tmp_path):
    changed(out, lambda c: c["predicate"].update(rate=0.999))
    assert run(["report", str(out), "--out", str(tmp_path / "page.html")]) == 1
    assert "out: the certificate does not follow from its trials: the figures do not" in capsys.readouterr().err
    assert "does not hold</p>" in (tmp_path / "page.html").read_text()


@pytest.mark.slow
def test_a_page_of_rows_that_are_gone_certifies_nothing(out):
    (out / "claim1" / "fresh" / "rows.jsonl").unlink()
    page = certificate_page(Chapter(name="Peg", content=read_asked(out)))
    assert "does not hold" in page and "has 0 of 259 trials" in page


@pytest.mark.slow
def test_the_page_says_what_the_certificate_does_not_know_and_which_code_ran(out):
    page = certificate_page(Chapter(name="Peg", content=read_asked(out)))
    for text in (
        "does not know of other folders",
        "Plug-ins are trusted code",
        "was chosen by the author of the claim",
    ):
        assert text in page
    core = next(each for each in json.loads((out / CERTIFICATE).read_text())["predicate"]["plugins"])
    assert f"{core['name']} {core['version']} {core['sha256'][:12]}" in page


def test_a_certificate_that_failed_is_checked_too(tmp_path):
    from test_certify import failed, inside

    never = ENGINE._replace(evaluate=lambda job: [failed(row) for row in inside(job)])
    out = asked(tmp_path)
    through(out, never)
    changed(out, lambda content: content["predicate"].update(certified=True))
    assert check_certificate(out, ValleyParams) == ["the figures do not follow from the trials: certified"]
    assert not procedure.claims(out) and read_question(out).rate == 0.95
