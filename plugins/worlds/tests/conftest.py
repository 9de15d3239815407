"""Robots, scenes and plants as the tests of the core's world have them."""

from tests.unit.world.conftest import plant, robot, scene, slide

__all__ = ["plant", "robot", "scene", "slide"]
