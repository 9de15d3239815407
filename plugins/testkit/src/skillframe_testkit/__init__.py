"""skillframe plug-in: a template for new plug-ins, and conformance checks for plug-ins.

`skillframe_testkit.suites` has pytest classes to inherit, `skillframe_testkit.checks` the checks as functions,
`skillframe_testkit.template` writes a new plug-in.
"""

from skillframe.extend import LazyCommand

skillframe_contract = "0.2"

new = LazyCommand("Write a working plug-in to start from.", "skillframe_testkit.command:new")
check = LazyCommand("Run the conformance checks of plug-ins.", "skillframe_testkit.command:check")
