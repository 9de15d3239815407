"""A page that is made anew while a campaign runs: no server, it loads itself again until the campaign has ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from skillframe.campaign.live import has_ended, runs_now
from skillframe.reports.page import write_chapters
from skillframe.reports.sources import campaign_folders, read_chapters

LOOK_S, REST = 1.0, 3.0
"""Wall time between two looks; how many times as long as the last page took to make there is rest after it (ours: a
quarter of one core at most)."""
Stamp = tuple[tuple[str, int, int], ...]


def watch_report(
    inputs: Sequence[Path], out: Path, tell: Callable[[str], None], sleep: Callable[[float], None] = time.sleep
) -> None:
    """Make the page whenever rows have come, until every campaign has ended. The last page is the caller's to make.

    Args:
        inputs: as for `write_report`.
        out: the HTML file, always whole.
        tell: is told in a sentence whenever a page was made, and when nobody runs a campaign that has not ended.
        sleep: waits so many seconds.

    Raises:
        InputError: as `write_report`.
        KeyboardInterrupt: Ctrl-C; the page that is there still loads itself again.
    """
    seen: Stamp | None = None
    idle = False
    while going := [folder for folder in campaign_folders(inputs) if not has_ended(folder)]:
        began, now = time.perf_counter(), _stamp(going)
        if now != seen:
            tell(_made(inputs, out))
            seen = now
        waits = [folder for folder in going if not runs_now(folder)]
        if waits and not idle:
            tell(f"nobody runs it now; to go on: skillframe campaign resume {waits[0]}")
        idle = bool(waits)
        sleep(max(LOOK_S, REST * (time.perf_counter() - began)))


def _made(inputs: Sequence[Path], out: Path) -> str:
    """Write a page that loads itself again. Says so with the number of runs that are in it."""
    chapters = read_chapters(inputs)
    write_chapters(chapters, out, live=True)
    there = sum(len(chapter.results.rows) for chapter in chapters if chapter.results)
    return f"{out}: {there} of {sum(chapter.planned for chapter in chapters)} runs counted"


def _stamp(folders: Sequence[Path]) -> Stamp:
    """What shows that something has come: size and time of the files that change while a campaign runs."""
    files = [folder / name for folder in folders for name in ("rows.jsonl", "results.csv", "summary.json")]
    return tuple((str(p), s.st_size, s.st_mtime_ns) for p in files if p.is_file() for s in [p.stat()])
