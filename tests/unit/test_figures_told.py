"""Figures that pages state can be made again: each section says by which command, or that there is none, and why.

A section of a page under docs/evidence that holds a table with figures, or any page's section that counts "N of M", has
a line `Command: ...`, a block with a command, or the words "No command" and a reason. In the change log an entry with a
measured figure names a command, a page of evidence that has the figure, or "(no command: why)". Every command that is
named so is looked up: the target of make, the files and tests of pytest, the module; that of skillframe in `test_docs`.
"""

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OF_HOW_IT_WORKS = {"explanation", "reference", "gallery"}  # settings and thresholds; made pages; `reproduced` names
TARGETS = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
COUNT = re.compile(r"\b\d+ of \d+\b")
MEASURED = re.compile(
    r"\b\d+ of \d+ (?!mm)|within [\d.]+ mm|\d+ times (?:faster|real time)|[\d.]+ s of processor time|factor of [\d.]+"
)
FENCE = re.compile(r"^ *```\w*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
TOLD = re.compile(r"[Cc]ommand:\s+(`[^`]+`(?:[^\n]|\n(?!\n))*)")  # to the end of the paragraph


def sections(text):
    """(heading, body) of a page, by headings of any depth. Lines in blocks are no headings."""
    parts = [("", [])]
    inside = False
    for line in text.splitlines():
        inside ^= line.lstrip().startswith("```")
        if line.startswith("#") and not inside:
            parts.append((line, []))
        parts[-1][1].append(line)
    return [(heading, "\n".join(lines)) for heading, lines in parts]


def told(body):
    """The commands that a section gives for its figures."""
    found = []
    for paragraph in TOLD.findall(body):
        first, *others = re.findall(r"`([^`]+)`", paragraph)
        found += [first, *filter(is_command, others)]
    for block in FENCE.findall(body):
        found += [line for line in block.splitlines() if is_command(line)]
    return found


def is_command(line):
    words = line.split("#")[0].split()
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        words = words[1:]
    return bool(words) and (words[0] in ("make", "skillframe", "pytest") or words[:2] == ["python", "-m"])


def wrong(command):
    """What is wrong with a command, or "". Those of skillframe are looked up in `test_docs`."""
    words = shlex.split(command.split("#")[0])
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        words = words[1:]
    if words[:1] == ["make"]:
        return "" if set(words[1:]) <= TARGETS else f"no target {words[1:]}"
    if words[:1] == ["skillframe"]:
        return ""
    if words[:3] == ["python", "-m", "pytest"] or words[:1] == ["pytest"]:
        return of_pytest(words[words.index("pytest") + 1 :])
    if words[:2] == ["python", "-m"]:
        return "" if ROOT.joinpath(*words[2].split(".")).with_suffix(".py").is_file() else f"no module {words[2]}"
    return f"no command: {command}"


def of_pytest(words):
    places = [word for word in words if word.startswith(("tests/", "plugins/"))]
    for place in places:
        file, _, name = place.partition("::")
        if not (ROOT / file).exists():
            return f"no file {file}"
        text = (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).is_file() else ""
        if "figures" in words and "mark.figures" not in text:
            return f"{file} holds no figures"
        if name and f"def {name}(" not in text:
            return f"no test {name} in {file}"
        names = re.findall(r"^def (test_\w+)", text, re.MULTILINE)
        if "-k" in words and not any(key in n for key in keys(words) for n in names):
            return f"no test of {file} is called {keys(words)}"
    return "" if places else "names no file"


def keys(words):
    return words[words.index("-k") + 1].replace(" or ", " ").split()


def pages():
    return [*DOCS.rglob("*.md"), ROOT / "README.md"]


def shows_figures(page, body):
    """A table or a block with figures on a page of evidence, or a count but where pages say how things work."""
    if page.parent.name == "evidence":
        rows = [line for line in body.splitlines() if line.lstrip().startswith("|")][2:]
        rows += [line for block in FENCE.findall(body) for line in block.splitlines() if not is_command(line)]
        return bool(COUNT.search(body)) or any(re.search(r"\d", row) for row in rows)
    return page.parent.name not in OF_HOW_IT_WORKS and bool(COUNT.search(body))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_section_with_figures_names_the_command_that_makes_them_or_says_that_there_is_none(page):
    whole = page.read_text(encoding="utf-8")
    for heading, body in sections(whole):
        if shows_figures(page, body):
            linked = "evidence/" in body or "tests/unit/" in body  # a page that is checked itself, or a test by name
            assert told(body) or re.search(r"[Nn]o\s+command", body) or (linked and page.parent.name != "evidence"), (
                f"{heading or 'the top'}: add 'Command: `...`', or 'No command:' and why"
            )


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_that_is_named_beside_figures_is_there(page):
    body = page.read_text(encoding="utf-8")
    named = told(body) if page.parent.name == "evidence" else told(FENCE.sub("", body))
    assert not [f"{command}: {wrong(command)}" for command in named if wrong(command)]


def entries(text):
    """The change log's entries, each with its continuation lines."""
    return [" ".join(entry.split()) for entry in re.findall(r"^- (.*?)(?=^- |^#|^$)", text, re.MULTILINE | re.DOTALL)]


def sources(entry):
    """Commands that an entry names in brackets, and pages of evidence that have its figures."""
    beside = " ".join(re.findall(r"\(([^()]*`[^()]*)\)", entry))
    named = [word for word in re.findall(r"`([^`]+)`", beside) if is_command(word) and not wrong(word)]
    for name in re.findall(r"docs/evidence/[\w-]+\.md", entry):
        figures = MEASURED.findall(entry)
        text = (ROOT / name).read_text(encoding="utf-8")
        named += [name] if all(figure.split()[1] in text for figure in figures) else []
    return named


def test_a_measured_figure_in_the_change_log_has_a_command_a_page_of_evidence_or_says_that_it_has_none():
    found = entries((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    measured = [entry for entry in found if MEASURED.search(entry)]
    assert len(measured) > 3
    assert not [e for e in measured if not sources(e) and "(no command: " not in e]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("make figures", ""), ("make figurs", "no target ['figurs']"), ("python -m tests.figures.crane_rivals", ""),
        ("python -m tests.figures.crane_rival", "no module tests.figures.crane_rival"),
        ("SEEN=... python -m pytest tests/figures/test_segmentation.py -m figures -s -k baselines", ""),
        ("python -m pytest tests/figures/test_segmentation.py -k baseball", "is called ['baseball']"),
        ("pytest tests/figures/test_none.py", "no file tests/figures/test_none.py"),
        ("pytest tests/unit/test_frames.py -m figures", "holds no figures"), ("rm -r x", "no command: rm -r x"),
    ],
)  # fmt: skip
def test_a_command_that_is_not_there_is_found_out(command, said):
    assert wrong(command).endswith(said) and bool(wrong(command)) == bool(said)


def test_a_page_without_its_command_is_found_out():
    page = DOCS / "evidence" / "search.md"
    assert shows_figures(page, "| a | b |\n|---|---|\n| peg | 3 |") and not told("| peg | 3 |")
    assert not shows_figures(page, "| a | b |\n|---|---|\n| peg | which |")
    assert told("Command: `make bench`, of `a.py`, and\n`python -m tests.x`.\n\n`make x`") == [
        "make bench",
        "python -m tests.x",
    ]
    assert told("```text\nskillframe worlds\n```") == ["skillframe worlds"]
