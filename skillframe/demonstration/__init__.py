"""Demonstrations: the record, its checks, and readers and writers of files."""
