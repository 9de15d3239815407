from .inputs import Robot as Robot
from .inputs import Settings as Settings
from .inputs import World as World
from .inputs import demonstrations_of as demonstrations_of
from .inputs import robot_of as robot_of
from .inputs import scene_of as scene_of
