"""Checks of a demonstration format: exact round trip, and errors for unreadable files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.errors import InputError
from skillframe.extend import ReaderType
from skillframe_testkit.checks.examples import example_demonstrations
from skillframe_testkit.checks.problems import attempt

ARRAYS = ("time", "position", "quaternion", "wrench")


def check_reader(reader: ReaderType) -> list[str]:
    """Problems of a format, with an example demonstration in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        problems = attempt("suffixes", lambda: _suffixes(reader))
        problems += attempt("round trip", lambda: _round_trip(reader, Path(folder)))
        problems += attempt("refusals", lambda: _refusals(reader, Path(folder)))
    return problems


def _suffixes(reader: ReaderType) -> Iterator[str]:
    if not reader.suffixes or not all(s.startswith(".") and s == s.lower() for s in reader.suffixes):
        yield f"suffixes are {reader.suffixes!r}; give file name endings such as '.csv', in lower case"


def _round_trip(reader: ReaderType, folder: Path) -> Iterator[str]:
    if reader.write is None:
        return
    demonstration, path = example_demonstrations()[0], folder / f"example{reader.suffixes[0]}"
    reader.write(demonstration, path)
    yield from differences(demonstration, reader.read(path, {}))


def differences(a: Demonstration, b: Demonstration) -> Iterator[str]:
    """Differences of `b` from `a` in samples (1e-9) and metadata, as sentences."""
    for name in ARRAYS:
        x, y = getattr(a, name), getattr(b, name)
        if x.shape != y.shape:
            yield f"{name} has shape {y.shape} when read back, was {x.shape}"
        elif np.abs(x - y).max() > 1e-9:  # s, m, 1, N: resolution that text must keep
            yield f"{name} differs by {np.abs(x - y).max():.3g} when read back"
    lost = [key for key, value in a.meta.items() if b.meta.get(key) != value]
    if lost:
        yield f"metadata changed when read back: {', '.join(lost)}"


def _refusals(reader: ReaderType, folder: Path) -> Iterator[str]:
    for name, content in {"missing": None, "empty": b"", "binary": bytes(range(256)) * 4}.items():
        path = folder / f"{name}{reader.suffixes[0]}"
        if content is not None:
            path.write_bytes(content)
        try:
            reader.read(path, {})
        except InputError as error:
            if path.name not in str(error):
                yield f"the refusal of a file that is {name} does not name the file: {error}"
        except Exception as error:  # code of a plug-in
            yield f"a file that is {name} raises {type(error).__name__}, not InputError"
        else:
            yield f"a file that is {name} is read without complaint"
