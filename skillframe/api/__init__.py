"""The Python API: record, learn, run, campaign, report, with objects, names and file paths alike.

Users import these names from `skillframe`. The command line calls the same functions.
"""
