"""The Python API: record, learn, run, campaign, report, with objects, names and file paths alike.

Users import these names from `skillframe`. The command line calls the same functions.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
