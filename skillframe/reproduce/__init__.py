"""The papers' results, row by row: which rows there are, computing them, keeping them, and showing them.

A row comes from whoever knows how to compute it: `skillframe_rows` of a plug-in, or of the core. Read `jobs` (what is
to be computed), `runner` (each row in a process of its own), `store` (what is kept), `page` and `document` (what is
shown), `committed` (has a verdict changed?).
"""
