"""skillframe plug-in: public benchmarks of assembly, run on parts that the user fetched (`skillframe benchmark`).

Read `assets` (which parts there are), `methods` (what is compared), `assembly` (one pair: world, demonstrations,
skills, campaigns), `runner` (many of them at a time), `scores` (the published check), `counts` (rates and intervals),
`page` (what is shown). This module is all that `skillframe --help` imports.
"""

from skillframe.extend.commands import LazyCommand

benchmark = LazyCommand("Public benchmarks, on your copy of their parts.", "skillframe_benchmarks.command:command")
