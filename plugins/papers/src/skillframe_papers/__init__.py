"""skillframe plug-in: the papers' results, row by row, and the command `skillframe reproduce` that computes them.

Read `published` (the rows, with what ours must reach), `rows` (a module a subject: how each is computed), `jobs` (what
is to be computed), `runner` (each group of rows in a process), `store` (what is kept), `page` and `document` (what is
shown), `committed` (has a verdict changed?). This module is all that `skillframe --help` imports.
"""

from skillframe.extend.commands import LazyCommand

reproduce = LazyCommand("The papers' results, row by row.", "skillframe_papers.command:command")
