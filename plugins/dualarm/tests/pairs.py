"""What the tests of runs share: robot, scene, the learned phase in a configuration."""

from functools import cache

from skillframe_dualarm.document import Arm, Phase, configured, relative
from skillframe_dualarm.dual_peg import DualPegParams, build

from skillframe.run.prepare import load_robot_model

SCENE = build(DualPegParams())
TIP = SCENE.tool.frames["tip"]
PHASE = Phase(arms=(Arm(center_of_compliance=TIP, share=1.0), Arm(center_of_compliance=TIP)))


@cache
def robot():
    return load_robot_model("dual_panda")


def phase(name):
    """A configuration; "E*" is the relative task of E."""
    made = configured(PHASE, name[0], SCENE.tool.frames)
    return relative(made) if name.endswith("*") else made
