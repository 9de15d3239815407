"""Banks of our cylinder, plants and URDFs, as the tests of FMUs, worlds and robots make them."""

from tests.unit.fmu.conftest import compiler, cylinder, cylinder2, own_cache, reference
from tests.unit.robot.conftest import save, urdf
from tests.unit.world.conftest import plant, robot, scene

__all__ = [
    "compiler", "cylinder", "cylinder2", "own_cache", "plant", "reference", "robot", "save", "scene", "urdf",
]  # fmt: skip
