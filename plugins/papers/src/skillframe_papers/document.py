"""The table of results as Markdown, for `skillframe reproduce` and the docs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skillframe_papers.bars import SAID, with_intervals

HEAD = ("row", "what", "published", "ours", "verdict", "values")
ORIGINS = {
    "predicted": "predicted: every constant was fixed before this figure was looked at",
    "chosen together": "chosen together: method and worlds were developed side by side; the seeds are fresh",
    "not computed": "not computed",
}


def render(entries: Sequence[Mapping[str, Any]]) -> str:
    """The table with its title, reproducible but for wall times."""
    return f"# The papers' results, row by row\n\n{body(entries)}"


def body(entries: Sequence[Mapping[str, Any]]) -> str:
    """The command, counts of verdicts, the table of rows, and a section for each."""
    wall, cpu = (sum(each[key] for each in entries) / 60.0 for key in ("wall_s", "cpu_s"))
    keys = ("row", "summary", "published", "ours", "verdict", "values_are")
    seeds, quick = {each["seed"] for each in entries}, any(each["quick"] for each in entries)
    seed = f" --seed {seeds.pop()}" if len(seeds) == 1 else ""
    lines = [
        "```text", f"skillframe reproduce{' --quick' if quick else ''}{seed} --out reproduce", "```", "",
        f"{len(entries)} rows: {_count(entries, 'pass')} pass, {_count(entries, 'fail')} fail, "
        f"{_count(entries, 'reported')} reported without a verdict. All rows took {wall:.1f} minutes of wall time and "
        f"{cpu:.1f} minutes of processor time. {SAID}", "",
        _row(HEAD), _row(["---"] * len(HEAD)),
        *(_row([with_intervals(each[key]) if key == "ours" else each[key] for key in keys]) for each in entries),
    ]  # fmt: skip
    for each in entries:
        lines += ["", *_details(each)]
    return "\n".join(lines) + "\n"


def origin(each: Mapping[str, Any]) -> str:
    """Whether the result was predicted, or constants were chosen with it in view."""
    if each["values_are"] == "calibrated":
        return f"calibrated: {each['calibrated']}"
    return ORIGINS[each["values_are"]]


def threshold(each: Mapping[str, Any]) -> str:
    """The threshold, and why reaching it would be weak evidence, if so."""
    if not each["bar"]:
        return "none: reported only"
    weak = each.get("weak")
    return str(each["bar"]) + (f". Reaching it is no pass: {weak}" if weak else "")


def _count(entries: Sequence[Mapping[str, Any]], verdict: str) -> int:
    return sum(each["verdict"] == verdict for each in entries)


def _row(cells: Sequence[object]) -> str:
    return f"| {' | '.join(_cell(cell) for cell in cells)} |"


def _cell(value: object) -> str:
    text = " ".join(str(value).split())
    for special in ("\\", "|", "*", "_", "<", "[", "`", "$"):
        text = text.replace(special, f"\\{special}")
    return text or " "


def _details(each: Mapping[str, Any]) -> list[str]:
    facts = [
        f"- published: {_cell(each['published'])} ({_cell(each['source'])})",
        f"- ours: {_cell(with_intervals(each['ours']))}",
        f"- threshold: {_cell(threshold(each))}; **{each['verdict']}**",
        f"- {origin(each)}",
    ]
    facts += [f"- difference: {_cell(with_intervals(each['difference']))}"] if each["difference"] else []
    facts += [f"- `{each['command']}`, {each['wall_s']:.0f} s ({each['cpu_s']:.0f} s of processor time)"]
    lines = [f"## Row {each['row']}: {_cell(each['summary'])}", "", *facts]
    table = each["table"]
    if table["rows"]:
        rows = [_row([with_intervals(cell) for cell in row]) for row in table["rows"]]
        lines += ["", _row(table["head"]), _row(["---"] * len(table["head"])), *rows]
    return lines
