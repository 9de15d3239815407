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
from skillframe.reports.page import write_report

Results = CampaignResults | SingleRun | Trace | File


def report(results: Results | Iterable[Results], out: File = "report.html") -> Path:
    """Write a report: what was learned, the runs with a 3-D replay, where the skill works, and how to repeat it.

    Args:
        results: campaign results, runs, traces, and the folders and files of these; one or several.
        out: the HTML file; it needs nothing else.

    Returns:
        the file.

    Raises:
        InputError: there is nothing to report on, or something cannot be read or written.
    """
    alone = isinstance(results, CampaignResults | SingleRun | Trace | str | os.PathLike)
    several: Iterable[Results] = [results] if alone else results  # type: ignore[list-item, assignment]
    if not isinstance(several, Iterable):
        raise InputError(f"{results!r:.60}", "is no result", "give runs, campaign results, or their files")
    with TemporaryDirectory() as folder:
        write_report(list(_files(several, Path(folder))), Path(out))
    return Path(out)


def _files(results: Iterable[Results], folder: Path) -> Iterator[Path]:
    """The folder or file of each. A run in memory is written for as long as the report is made."""
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
