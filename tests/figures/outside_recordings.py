"""Whether the recordings that came from outside are read rightly: `python -m tests.figures.outside_recordings`.

`$SKILLFRAME_RECORDINGS/outside_recordings/make.py SEED` makes 23 kinds of recordings into a temporary folder. Each is
given to the command that its README names, through the real command line. What comes back is held against the motion
and the wrench that make.py wrote. Prints kind | files | right | what was said. `--seed 0 1 2` and `--kinds 01 16`
choose; `--files` prints one line for each file.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import runpy
import shlex
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Float
from tests.references import recordings_dir


class Refused(Exception):
    """What a command said where it was expected to give an answer."""


class Answer(NamedTuple):
    """Exit code, standard output and standard error of a command."""

    code: int
    out: str
    err: str

    @property
    def text(self) -> str:
        """All that was said, on one line."""
        return " ".join(f"{self.out} {self.err}".split())

    @property
    def document(self) -> Any:
        """What `--json` printed, the first of a list. Raises `Refused` where nothing was."""
        try:
            found = json.loads(self.out)
        except ValueError:
            raise Refused(self.text) from None
        if not found:
            raise Refused(self.text)
        return found[0] if isinstance(found, list) else found


def typed(*words: object) -> Answer:
    """Run a command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(word) for word in words])
    return Answer(code, out.getvalue(), err.getvalue())


class Score(NamedTuple):
    """Whether the answer to one file is right, and what was said."""

    file: str
    right: bool
    said: str


class Truth(NamedTuple):
    """What make.py wrote: time [s], position [m], attitude, wrench of the environment on the tool in base axes."""

    time: Float
    position: Float
    attitude: Rotation
    wrench: Float

    def differs(self, d: Demonstration, *, axes_open: bool = False) -> str:
        """In what a demonstration differs; "" where it is the same.

        1 mm, 1 degree and 0.5 N are beyond noise, resolution and stamps spread over a sample, and far below any
        mistake in columns, axes, signs or units. With open axes the force is compared by its size.
        """
        at = d.time - d.time[0]
        if abs(at[-1] - (self.time[-1] - self.time[0])) > 0.02 * at[-1]:
            return f"lasts {at[-1]:.4g} s"
        row = np.clip(np.searchsorted(self.time, at + self.time[0] - 1e-9), 0, len(self.time) - 1)
        if (far := np.abs(d.position - self.position[row]).max()) > 1e-3:
            return f"position off by {far:.3g} m"
        turn = np.degrees((Rotation.from_quat(d.quaternion).inv() * self.attitude[row]).magnitude().max())
        if turn > 1.0:
            return f"attitude off by {turn:.3g} degrees"
        force, true = d.wrench[:, :3], self.wrench[row, :3]
        error = np.linalg.norm(force, axis=1) - np.linalg.norm(true, axis=1) if axes_open else force - true
        rms = float(np.sqrt(np.mean(error**2)))
        return f"force off by {rms:.3g} N" if rms > 0.5 else ""


class Made:
    """One seed's files, and the functions that made them."""

    def __init__(self, make: Path, folder: Path, seed: int) -> None:
        self.folder, self.seed, argv = folder, seed, sys.argv
        try:
            sys.argv = [str(make), str(seed)]
            with contextlib.chdir(folder):
                self.names: dict[str, Any] = runpy.run_path(str(make), run_name="__main__")
        finally:
            sys.argv = argv
        if seed:
            self._draw_touches(np.random.default_rng(seed))

    def slide(self, *arguments: Any, **settings: Any) -> Truth:
        """The slide that make.py wrote with these settings."""
        return Truth(*self.names["slide"](*arguments, **settings))

    def files(self, kind: str) -> list[Path]:
        """The files of a kind."""
        return sorted(self.folder.glob(f"{kind}*"))

    def _draw_touches(self, g: np.random.Generator) -> None:
        """Kind 12 is of three draws that make.py holds for every seed; here three others take their place."""
        for path in self.files("12"):
            path.unlink()
        for i in range(3):
            t, p, q, w = self.names["touch"](
                rate=int(g.choice([100, 200, 500])), turn=g.uniform(0, 20), seed=int(g.integers(1 << 30)),
                press=g.uniform(8, 25), mu=g.uniform(0.2, 0.5), way=g.uniform(0.05, 0.12),
                wait=g.choice([0.1, 0.3, 0.5]), down=g.uniform(1.2, 2.2), lift=g.choice([0.02, 0.05]),
            )  # fmt: skip
            self.names["save"](self.folder / f"12_drawn_{i}.csv", self.names["H"], t, p, q.as_quat(), w)


def proposed(path: Path, *options: object) -> tuple[dict[str, Any], Answer]:
    """The proposal of `--layout auto`, empty where there is none, and the answer."""
    answer = typed("check", path, "--layout", "auto", *options, "--json")
    return (answer.document if answer.code < 2 else {}), answer


def as_proposed(made: Made, found: dict[str, Any], *more: object) -> Demonstration | str:
    """The demonstration that the proposed line reads, or the error."""
    return converted(made, *shlex.split(found["line"])[2:], *more)


def converted(made: Made, *words: object) -> Demonstration | str:
    """The demonstration that `convert` writes, or the error."""
    answer = typed("convert", *words, "--out", made.folder / "read.npz")
    return answer.err.strip() if answer.code else read_demonstration(made.folder / "read.npz")


def told(found: dict[str, Any], *lists: str) -> list[str]:
    """Sentences of a proposal or an audit."""
    return [text for name in lists for text in found.get(name, [])]


def says(sentences: Sequence[str], *patterns: str) -> str:
    """The first sentence in which all patterns are found, "" where there is none."""
    return next((s for s in sentences if all(re.search(p, s, re.IGNORECASE) for p in patterns)), "")


class Learned(NamedTuple):
    """What `learn` made: its exit code, push direction or None, free axes, and all that it said."""

    code: int
    push: Float | None
    free: Float
    said: str

    def off(self, direction: Sequence[float]) -> float:
        """Angle of the push to a direction [degrees]; 180 where nothing is pushed."""
        if self.push is None:
            return 180.0
        return float(np.degrees(np.arccos(np.clip(self.push @ np.asarray(direction), -1, 1))))

    @property
    def slides(self) -> bool:
        """Whether it is a push along -z that is free along x, as far as `learn` says that it knows the push.

        One slide to one side leaves it open. It names axes to 15 degrees.
        """
        said = re.search(r"the push is (?:open: up|known) to (?:about )?(\d+) degrees", self.said)
        most = max(15.0, float(said[1])) if said else 15.0
        along = np.linalg.norm(self.free @ np.array([[1.0], [0.0], [0.0]]), axis=1)
        return self.off([0, 0, -1]) < most and bool(np.any(along > np.cos(np.radians(most))))

    @property
    def sure(self) -> bool:
        """Whether it claims to know the push."""
        return "the push is known" in self.said


def learned(made: Made, *files: object) -> Learned:
    """Learn a skill from files."""
    skill = made.folder / "learned.json"
    skill.unlink(missing_ok=True)
    answer = typed("learn", *files, "--out", skill)
    if answer.code or not skill.exists():
        return Learned(answer.code, None, np.zeros((0, 3)), answer.text)
    moved = json.loads(skill.read_text())["phases"][0]["translation"]
    push = moved["desired_direction"]
    free = np.reshape(moved["compliant_axes"], (-1, 3))
    return Learned(0, None if push is None else np.array(push), free, answer.text)


def short(text: str) -> str:
    """What was said, cut to a line."""
    line = " ".join(text.split())
    return line if len(line) <= 150 else f"{line[:147]}..."


def made_files(seed: int) -> Iterator[Made]:
    """The files of a seed, as long as they are looked at. Nothing where make.py is absent."""
    base = recordings_dir()
    make = None if base is None else base / "outside_recordings" / "make.py"
    if make is None or not make.is_file():
        return
    with tempfile.TemporaryDirectory() as place:
        yield Made(make, Path(place), seed)


def main() -> None:
    """Print the table."""
    from tests.figures.outside_answers import KINDS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, nargs="+", default=[0])
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    parser.add_argument("--files", action="store_true", help="Print one line for each file.")
    chosen = parser.parse_args()
    scores: dict[str, list[Score]] = {kind: [] for kind in chosen.kinds}
    for seed in chosen.seed:
        for made in made_files(seed):
            for kind in chosen.kinds:
                scores[kind] += KINDS[kind](made)
    if not any(scores.values()):
        print("SKILLFRAME_RECORDINGS holds no outside_recordings/make.py: nothing was judged")
        return
    print("| kind | files | right | what was said |\n|---|---|---|---|")
    for kind, found in scores.items():
        wrong = [score for score in found if not score.right]
        said = f"wrong: {wrong[0].file}: {wrong[0].said}" if wrong else found[0].said if found else "no file"
        print(f"| {kind} | {len(found)} | {len(found) - len(wrong)} | {short(said)} |")
        for score in found if chosen.files else []:
            print(f"    {'right' if score.right else 'WRONG'}  {score.file}: {short(score.said)}")


if __name__ == "__main__":
    main()
