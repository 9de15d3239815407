"""Robots behind ROS 2: a link over DDS to a Cartesian impedance controller, and a fake one.

Listing plug-ins imports this module only.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import Lazy, LinkType

skillframe_contract = "0.2"


@hookimpl
def skillframe_links() -> Iterable[LinkType]:
    """Pose, stiffness, damping and wrench, 500 times a second."""
    yield LinkType(
        name="ros2", summary="crisp_controllers' Cartesian impedance controller in ROS 2, over DDS", takes="impedance",
        open=Lazy("skillframe_ros2.link:Ros2Link"), fake=Lazy("skillframe_ros2.fake:FakeCrisp"), robot="fr3",
    )  # fmt: skip
