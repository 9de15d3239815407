"""Cylinders and motors of a machine as components of a system of FMUs, for other masters (SSP).

Open at its mechanics: motion and commands go in, forces come out. Pumps are no FMUs but a part of the coupling
(`skillframe_hydraulics.supply`), so that the pressure a line has lost is an input of the system, shared by the
actuators that it feeds, and their flows are outputs.
"""

from __future__ import annotations

from skillframe.fmu import INPUTS, OUTPUTS, Component
from skillframe.robot import ClosedChain, RobotModel
from skillframe_hydraulics.checks.figures import CYLINDER, completed
from skillframe_hydraulics.cylinder.bank import instance_parameters
from skillframe_hydraulics.declared import fed, supplies_of
from skillframe_hydraulics.drive import holding_force
from skillframe_hydraulics.supply import NEEDED_IN, needed_by_lines


def components(model: RobotModel) -> list[Component]:
    """Actuators of a machine, named by their joints, at rest at home.

    An input is JOINT_NAME by our names, such as stick_rod_command, and SUPPLY_supply_drop of a declared supply.

    Raises:
        InputError, OutOfReach: the machine cannot stand at home.
    """
    spec, chain = model.spec, ClosedChain(model)
    z = chain.minimal(chain.home)
    place = dict(zip(chain.model.names[1:], chain.configuration(z), strict=True))
    held = instance_parameters(spec, {}, holding_force(chain, z[None], {}))
    lines = {joint: name for name, one in supplies_of(spec).items() for joint in fed(spec, one)}
    found = []
    for a, start in zip(spec.actuation, held, strict=True):
        usual = a.fmu == CYLINDER
        inputs = dict(a.inputs) or {name: name for name in INPUTS}
        outputs = dict(a.outputs) or {name: name for name in OUTPUTS}
        if a.joint in lines and usual:
            needed = needed_by_lines(spec)
            inputs |= {name: name for name in needed[0]}
            outputs |= {name: name for name in needed[1]}
        line = lines.get(a.joint, a.joint)
        found.append(Component(
            name=a.joint, fmu=a.fmu, parameters=completed(a),
            start={**start, **({inputs["position"]: place[a.joint]} if "position" in inputs else {})},
            inputs={f"{line if ours == NEEDED_IN else a.joint}_{ours}": theirs for ours, theirs in inputs.items()},
            outputs={f"{a.joint}_{ours}": theirs for ours, theirs in outputs.items()},
        ))  # fmt: skip
    return found
