"""Damaged files of other tools' formats: `python -W ignore -m tests.figures.fuzzing_formats COUNT SEED`.

The kinds are those that `tests/unit/demonstration/test_foreign_formats.py` and `test_layouts.py` write, and MCAP
files of another encoding. Each is checked, converted, and its line proposed.
"""

from __future__ import annotations

import sys
import tempfile
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from skillframe.demonstration.columns import CANONICAL
from skillframe.demonstration.csv import demonstration_columns
from tests.figures.fuzzing import command, read, some
from tests.oracle import fuzz
from tests.oracle.fuzz import Case
from tests.unit.demonstration.test_foreign_formats import FORMATS
from tests.unit.demonstration.test_layouts import sparse
from tests.unit.demonstration.test_mcap_checksums import record, text

LARGEST_TARGETS = 2
"""Files of a data set that are damaged: its description and one table."""


def cases(folder: Path) -> list[Case]:
    """Every kind, sound, of sixty samples."""
    return [*tables(folder), *layouts(), *mcaps()]


def asked(name: str, options: dict[str, Any]) -> list[list[str]]:
    """What is typed: mostly the line that names the columns."""
    words = [word for key, value in options.items() for word in (f"--{key}", str(value))]
    rest = [word for key, value in options.items() if key != "columns" for word in (f"--{key}", str(value))]
    check, file = ["demonstration", "check"], f"{{}}/{name}"
    return [
        [*check, file, *words], [*check, file, *words, "--json"],
        ["demonstration", "convert", file, *words, "--out", "{}/out/a.npz"], [*check, file, *rest, "--columns", "auto"],
    ]  # fmt: skip


def tables(folder: Path) -> list[Case]:
    """Files of other libraries."""
    found = []
    for form, write in FORMATS.items():
        place = folder / form
        place.mkdir()
        path, options = write(place, some(60))
        files = read(place)
        name = path.relative_to(place).as_posix()
        targets = [name] if name in files else sorted(files, key=importance)[:LARGEST_TARGETS]
        found += [Case(f"{form} {Path(t).suffix}", files, t, asked(name, options), 1.0 / len(targets)) for t in targets]
    return found


def importance(name: str) -> int:
    """The description of a data set first, then the table of the episode that is read."""
    return 0 if name.endswith(".json") else 1 if name.endswith(("1.parquet", "file-000.parquet")) else 2


def layouts() -> list[Case]:
    """Text as other tools save it."""
    demo = some(60)
    columns = demonstration_columns(demo)
    rows = [list(CANONICAL), *([repr(float(columns[n][i])) for n in CANONICAL] for i in range(len(demo)))]
    comma = [rows[0], *([cell.replace(".", ",") for cell in row] for row in rows[1:])]
    moments = [datetime(2026, 1, 31, 10) + timedelta(milliseconds=10 * i) for i in range(len(demo))]
    dates = [rows[0], *([m.isoformat(" "), *row[1:]] for m, row in zip(moments, rows[1:], strict=True))]
    split = [
        ["sec", "nsec", *rows[0][1:]],
        *([str(i // 100), str(i % 100 * 10**7), *r[1:]] for i, r in enumerate(rows[1:])),
    ]
    made = {
        "decimal comma": (comma, ";", {}), "dates": (dates, ";", {}),
        "split clock": (split, ",", {"columns": ",".join(split[0])}), "sparse": (sparse(rows, 4), ",", {}),
    }  # fmt: skip
    return [
        Case(kind, {"demo.csv": "\n".join(sep.join(row) for row in cells).encode() + b"\n"}, "demo.csv",
             asked("demo.csv", options))
        for kind, (cells, sep, options) in made.items()
    ]  # fmt: skip


def mcaps() -> list[Case]:
    """Recordings whose messages are not ROS's."""
    magic, found = b"\x89MCAP0\r\n", []
    for encoding in ("json", "protobuf"):
        schema = record(3, b"\x01\0" + text("Wrench") + text("jsonschema") + len(b"{}").to_bytes(4, "little") + b"{}")
        channel = record(4, b"\x01\0\x01\0" + text("/ft") + text(encoding) + bytes(4))
        message = record(5, b"\x01\0" + bytes(4) + bytes(16) + b'{"force": {"x": 1.0}}')
        content = (
            magic + record(1, text("") + text("a recorder")) + schema + channel + 5 * message + record(15, bytes(4))
        )
        file = content + record(2, bytes(20)) + magic
        sound = [
            ["demonstration", "check", "{}/log.mcap"],
            ["demonstration", "check", "{}/log.mcap", "--columns", "auto"],
        ]
        found.append(Case(f"mcap of {encoding}", {"log.mcap": file}, "log.mcap", sound, 0.5, refused=True))
    return found


def main(count: int, seed: str) -> int:
    """Print what came of so many damaged files. The exit code is 1 if a promise was broken."""
    with tempfile.TemporaryDirectory() as place:
        found = fuzz.fuzz(cases(Path(place)), command, count, seed, Path(place))
    print(f"seed {seed}", *fuzz.table(found), *map(str, found.bad), sep="\n")
    return int(bool(found.bad) or sum(found.counts.values()) != count)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
