"""Demonstrations: the record, its audit, and the readers and writers of files."""
