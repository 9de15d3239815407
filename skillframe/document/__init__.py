"""Skill files: naming, reading, writing and exporting."""
