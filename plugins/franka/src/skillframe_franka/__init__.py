"""Franka Research 3: a link through pylibfranka, and a fake controller. Listing plug-ins imports this module only."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, LinkType

skillframe_contract = "0.2"


@hookimpl
def skillframe_links() -> Iterable[LinkType]:
    """Joint torques, 1000 times a second."""
    yield LinkType(
        name="franka", summary="Franka Research 3 by joint torques, through pylibfranka", takes="torque",
        open=Lazy("skillframe_franka.link:FrankaLink"), fake=Lazy("skillframe_franka.fake:FakeFranka"), robot="fr3",
    )  # fmt: skip
