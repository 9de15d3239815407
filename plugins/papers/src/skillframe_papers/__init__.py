"""Plug-in for the papers' results, row by row, and the command `skillframe reproduce`.

Reading order: `published` (rows and thresholds), `rows` (computation), `jobs`, `runner`, `store`, `page`, `document`,
`committed`. `skillframe --help` imports this module only.
"""

from skillframe.extend import LazyCommand

reproduce = LazyCommand("The papers' results, row by row.", "skillframe_papers.command:command")
