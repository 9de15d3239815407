"""Proposed layout of a foreign table, with reasons and open questions."""
