"""Demonstrations: the record, its checks, and readers and writers of files."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
