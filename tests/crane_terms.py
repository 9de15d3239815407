"""The crane's terms trial by trial from the loop-embedding model, Coriolis' part by another way than the law's."""

import numpy as np
import pinocchio as pin
from skillframe_hydraulics.law.hydraulic import Terms


def mass_rate_term(state):
    """C_z^T zd = G' C' v + (dG/dt)' M v (n,), Christoffel's C of the tree."""
    model = state.chain.model
    data = model.createData()
    coriolis = pin.computeCoriolisMatrix(model, data, state.q, state.v)
    embedding_rate = np.array([state.drift_of(unit) for unit in np.eye(len(state.z))]).T
    return state.embedding.T @ coriolis.T @ state.v + embedding_rate.T @ state.tree_mass @ state.v


def one(chain, z, zd):
    """Terms of one state, without the leading dimension."""
    state = chain.at(z, zd)
    frame = chain.robot.tool_frames[0]
    jacobian = state.jacobian(frame)[[0, 2]]
    tip = np.array(state.data.oMf[frame].translation)[[0, 2]]
    return Terms(
        state.mass, mass_rate_term(state), state.gravity, jacobian, state.arms, *state.driven_motion, tip,
        jacobian @ zd, state.load_gravity,
    )  # fmt: skip


def terms(chain, z, rate):
    """Terms of N states."""
    return Terms(*(np.array(x) for x in zip(*(one(chain, a, b) for a, b in zip(z, rate, strict=True)), strict=True)))
