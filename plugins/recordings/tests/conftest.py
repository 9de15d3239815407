"""Demonstrations made from closed forms, as the core's tests have them."""

from tests.unit.demonstration.conftest import demo, rows, write  # noqa: F401
