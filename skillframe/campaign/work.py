"""What a pool carries out: a job of a known size that gives rows, a chunk of trials or a group of published results."""

from __future__ import annotations

from typing import Protocol, TypeVar


class Work(Protocol):
    """A job. It is pickled on its way to a worker."""

    @property
    def size(self) -> int:
        """How many rows it gives. Progress is counted in them."""


WorkT = TypeVar("WorkT", bound=Work)
