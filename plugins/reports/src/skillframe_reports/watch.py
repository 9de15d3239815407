"""Page that is rewritten while a campaign runs, and reloads itself until the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from skillframe.campaign import has_ended, runs_now
from skillframe_reports.page import write_chapters
from skillframe_reports.sources import campaign_folders, read_chapters

Stamp = tuple[tuple[str, int, int], ...]


def watch_report(
    inputs: Sequence[Path], out: Path, tell: Callable[[str], None], sleep: Callable[[float], None] = time.sleep
) -> None:
    """Write the page whenever there are new rows, until every campaign has ended. The caller writes the last page.

    Args:
        inputs: as for `write_report`.
        out: the HTML file, always whole.
        tell: receives a sentence for each page, and if an unfinished campaign is not running.
        sleep: waits so many seconds.

    Raises:
        InputError: as `write_report`.
        KeyboardInterrupt: Ctrl-C; the existing page still reloads itself.
    """
    seen: Stamp | None = None
    idle = False
    while going := [folder for folder in campaign_folders(inputs) if not has_ended(folder)]:
        files = [folder / name for folder in going for name in ("rows.jsonl", "results.csv", "summary.json")]
        began, now = (
            time.perf_counter(),
            tuple((str(p), s.st_size, s.st_mtime_ns) for p in files if p.is_file() for s in [p.stat()]),
        )
        if now != seen:
            chapters = read_chapters(inputs)
            write_chapters(chapters, out, live=True)
            there = sum(len(chapter.results.rows) for chapter in chapters if chapter.results)
            tell(f"{out}: {there} of {sum(chapter.planned for chapter in chapters)} runs counted")
            seen = now
        waits = [folder for folder in going if not runs_now(folder)]
        if waits and not idle:
            tell(f"nobody runs it now; to go on: skillframe campaign resume {waits[0]}")
        idle = bool(waits)
        sleep(max(1.0, 3.0 * (time.perf_counter() - began)))  # at most a quarter of a core
