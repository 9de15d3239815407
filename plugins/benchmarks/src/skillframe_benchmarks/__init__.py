"""Plug-in for assembly of parts that the user has: public benchmarks, and practice without a demonstration.

`skillframe benchmark`, in reading order: `assets` (parts), `methods`, `assembly` (one pair), `runner`, `scores`,
`counts`, `page`. `skillframe practise`: `practice`. `skillframe --help` imports this module only.
"""

from skillframe.extend import LazyCommand

benchmark = LazyCommand("Public benchmarks, on your copy of their parts.", "skillframe_benchmarks.command:command")
practise = LazyCommand("Teach a skill from two meshes alone.", "skillframe_benchmarks.practice_command:command")
