"""The crane with its three cylinders in exudyn, an independent multibody code with a hydraulic actuator of its own.

Planar: seven rigid bodies with their masses, centres and inertias as the URDF says them at the start, six pins, three
slides. The actuator (two chambers, square-root edges, viscous damping) is one system with the mechanics and is
integrated implicitly. It has no spool, seals, leakage or laminar edge: leave them out of ours to compare.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

PLANE = [0, 2]  # base x and z


class History(NamedTuple):
    """Rows every `every` seconds, the start first: time (T,), piston (T, 3), pressures (T, 3) each [Pa]."""

    time: np.ndarray
    piston: np.ndarray
    pressure_a: np.ndarray
    pressure_b: np.ndarray


class Crane:
    """Builds and runs.

    Args:
        chain: closed chain; z: start, at rest.
        cylinders: parameters of `hydraulic_cylinder`, one mapping per piston of the chain.
        pressures: (3, 2) at the start [Pa].
    """

    def __init__(self, chain, z, cylinders, pressures):
        import exudyn as exu

        self.exu, self.chain = exu, chain
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.data = chain.model.createData()
        self.start = chain.configuration(np.asarray(z))
        pin.framesForwardKinematics(chain.model, self.data, self.start)
        self._bodies()
        self._pins_and_slides()
        self.actuators = [
            self._actuator(j, p, s) for j, p, s in zip(range(3), cylinders, np.asarray(pressures), strict=True)
        ]
        self.mbs.Assemble()

    def _bodies(self):
        import exudyn.itemInterface as items  # noqa: N813  its own name

        mbs, model = self.mbs, self.chain.model
        self.bodies, self.origins = {0: mbs.AddObject(items.ObjectGround())}, {0: np.zeros(2)}
        for j in range(1, model.njoints):
            inertia, place = model.inertias[j], self.data.oMi[j]
            center = place.act(np.array(inertia.lever))[PLANE]
            about = (place.rotation @ inertia.inertia @ place.rotation.T)[1, 1]
            node = mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=[*center, 0.0]))
            self.bodies[j] = mbs.AddObject(items.ObjectRigidBody2D(mass=inertia.mass, inertia=about, nodeNumber=node))
            self.origins[j] = center
            marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=self.bodies[j]))
            mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0.0, -9.81, 0.0]))

    def _marker(self, joint, point):
        from exudyn.itemInterface import MarkerBodyRigid

        local = [*(np.asarray(point) - self.origins[joint]), 0.0]
        return self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=self.bodies[joint], localPosition=local))

    def _joint_at(self, joint):
        return self.data.oMi[joint].translation[PLANE]

    def _pin(self, one, other, point):
        from exudyn.itemInterface import ObjectJointRevolute2D

        markers = [self._marker(one, point), self._marker(other, point)]
        self.mbs.AddObject(ObjectJointRevolute2D(markerNumbers=markers))

    def slide(self, joint):
        """Direction of a prismatic joint in the plane."""
        axis = np.array(self.chain.model.joints[joint].createData().S, dtype=float).reshape(6)[:3]
        return (self.data.oMi[joint].rotation @ axis)[PLANE]

    def _pins_and_slides(self):
        from exudyn.itemInterface import ObjectJointPrismatic2D

        model = self.chain.model
        for j in range(1, model.njoints):
            parent = model.parents[j]
            if not model.joints[j].shortname().startswith("JointModelP"):
                self._pin(parent, j, self._joint_at(j))
                continue
            along = self.slide(j)
            markers = [self._marker(parent, self._joint_at(j)), self._marker(j, self._joint_at(j))]
            self.mbs.AddObject(
                ObjectJointPrismatic2D(
                    markerNumbers=markers, axisMarker0=[*along, 0.0], normalMarker1=[-along[1], along[0], 0.0]
                )
            )
        for loop in self.chain.loops:
            one, other = (model.frames[frame].parentJoint for frame in loop.frames)
            self._pin(other, one, self.data.oMf[loop.frames[0]].translation[PLANE])

    def _ends(self, index):
        """(joint, point) of both ends of a cylinder, and its length when the piston is in."""
        model = self.chain.model
        for _, rod in (loop.frames for loop in self.chain.loops):
            slider = model.frames[rod].parentJoint
            if model.joints[slider].idx_v == self.chain.driven[index]:
                barrel, rod_eye = model.parents[slider], self.data.oMf[rod].translation[PLANE]
                closed = np.linalg.norm(rod_eye - self._joint_at(barrel)) - self.start[self.chain.driven[index]]
                return (barrel, self._joint_at(barrel)), (slider, rod_eye), closed
        joint = next(j for j in range(model.njoints) if model.joints[j].idx_v == self.chain.driven[index])
        here, along = self._joint_at(joint), self.slide(joint)
        behind = here - (1.0 + self.start[self.chain.driven[index]]) * along
        return (model.parents[joint], behind), (joint, here), 1.0

    def _actuator(self, index, p, pressures):
        from exudyn.itemInterface import HydraulicActuatorSimple, NodeGenericODE1

        one, other, closed = self._ends(index)
        area = np.pi / 4 * p["bore"] ** 2
        state = self.mbs.AddNode(
            NodeGenericODE1(
                referenceCoordinates=[0.0, 0.0], initialCoordinates=list(pressures), numberOfODE1Coordinates=2
            )
        )
        actuator = self.mbs.AddObject(
            HydraulicActuatorSimple(
                markerNumbers=[self._marker(*one), self._marker(*other)], nodeNumbers=[state],
                offsetLength=closed, strokeLength=p["stroke"],
                chamberCrossSection0=area, chamberCrossSection1=area - np.pi / 4 * p["rod"] ** 2,
                hoseVolume0=p["dead_volume_a"], hoseVolume1=p["dead_volume_b"], actuatorDamping=p["viscous_friction"],
                oilBulkModulus=p["bulk_modulus"], cylinderBulkModulus=1e30, hoseBulkModulus=1e30,
                nominalFlow=p["rated_flow"] / np.sqrt(p["rated_pressure_drop"]), systemPressure=p["supply_pressure"],
                tankPressure=p["return_pressure"], useChamberVolumeChange=True,
            )
        )  # fmt: skip
        return actuator, state, closed

    def _state(self):
        exu, rows = self.exu, []
        for actuator, state, closed in self.actuators:
            length = self.mbs.GetObjectOutput(actuator, exu.OutputVariableType.Distance)
            rows.append((length - closed, *self.mbs.GetNodeOutput(state, exu.OutputVariableType.Coordinates)))
        return rows

    def run(self, commands, period, step):
        """Hold each row of commands (T, 3) for a period [s], integrating in steps. A row of `History` per period."""
        exu, mbs = self.exu, self.mbs
        settings = exu.SimulationSettings()
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.solution.file.write = False
        settings.timeIntegration.numberOfSteps = round(len(commands) * period / step)
        settings.timeIntegration.endTime = len(commands) * period
        each, rows = round(period / step), [self._state()]
        counter = iter(range(10**9))

        def before(mbs, t):
            k = next(counter)
            if k % each == 0:
                if k:
                    rows.append(self._state())
                for (actuator, _, _), u in zip(self.actuators, commands[k // each], strict=True):
                    mbs.SetObjectParameter(actuator, "valveOpening0", u)
                    mbs.SetObjectParameter(actuator, "valveOpening1", -u)
            return True

        mbs.SetPreStepUserFunction(before)
        mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
        rows.append(self._state())
        table = np.array(rows)
        return History(np.arange(len(rows)) * period, table[:, :, 0], table[:, :, 1], table[:, :, 2])
