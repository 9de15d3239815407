"""`report`: one self-contained HTML page from runs and campaigns."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from skillframe.api.campaigns import CampaignResults
from skillframe.api.inputs import File
from skillframe.api.running import SingleRun
from skillframe.errors import InputError
from skillframe.execution.trace import Trace
from skillframe.extend.outputs import no_progress
from skillframe.extend.registry import registry

Results = CampaignResults | SingleRun | Trace | File


def report(results: Results | Iterable[Results], out: File = "report.html") -> Path:
    """Write a report: what was learned, the runs with a 3-D replay, where the skill works, and how to repeat it.

    Args:
        results: campaign results, runs, traces, or their folders and files; one or several.
        out: the self-contained HTML file.

    Returns:
        the file.

    Raises:
        InputError: there is nothing to report on, or something cannot be read or written.
        UnknownName: skillframe-reports, which writes the page, is not installed.
    """
    alone = isinstance(results, CampaignResults | SingleRun | Trace | str | os.PathLike)
    several: Iterable[Results] = [results] if alone else results  # type: ignore[list-item, assignment]
    if not isinstance(several, Iterable):
        raise InputError(f"{results!r:.60}", "is no result", "give runs, campaign results, or their files")
    with TemporaryDirectory() as folder:
        registry().output("report").write(list(_files(several, Path(folder))), Path(out), no_progress)
    return Path(out)


def _files(results: Iterable[Results], folder: Path) -> Iterator[Path]:
    for number, each in enumerate(results, start=1):
        if isinstance(each, CampaignResults):
            yield each.folder
        elif isinstance(each, SingleRun | Trace):
            file = folder / f"run{number}.npz"
            (each.trace if isinstance(each, SingleRun) else each).save(file)
            yield file
        elif isinstance(each, str | os.PathLike):
            yield Path(each)
        else:
            raise InputError(f"{each!r:.60}", "is no result", "give runs, campaign results, or their files")
