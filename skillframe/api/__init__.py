"""The Python API: record, learn, run, campaign, report, with objects, names and file paths alike (ours).

A user imports these names from `skillframe` itself. The command line calls the same functions.
"""
