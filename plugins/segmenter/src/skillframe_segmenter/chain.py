r"""Forward and backward probabilities of a Markov chain whose transitions change from step to step, in blocks.

    alpha_t = alpha_{t-1} A_t,    beta_{t-1} = A_t beta_t,    A_t(i, j) = P_t(i, j) b_t(j)

A loop over T windows is what makes such a model slow in Python. The products of the K x K matrices A_t are therefore
taken in about sqrt(T) blocks side by side, all demonstrations at once: prefix products inside every block, then one
vector handed from block to block. All products are rescaled as they grow, so that nothing underflows. The result is
that of the loop to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

TINY = 1e-300


class Smoothed(NamedTuple):
    """Probabilities over whole demonstrations; B demonstrations, T windows, K phases.

    Attributes:
        posterior: (B, T, K) p(phase at t | all windows).
        forward: (B, T, K) p(phase at t | windows up to t).
        backward: (B, T, K) up to a factor per window.
        log_likelihood: (B,).
    """

    posterior: Float
    forward: Float
    backward: Float
    log_likelihood: Float


def smooth(initial: Float, emission: Float, transition: Float) -> Smoothed:
    """Forward and backward probabilities.

    Args:
        initial: (K,) probabilities of the first window.
        emission: (B, T, K) log densities; 0 in windows that only fill up a shorter demonstration.
        transition: (B, T - 1, K, K), or (K, K) for all; identity into windows that only fill up.
    """
    highest = emission.max(axis=-1, keepdims=True)
    density = np.exp(emission - highest) + TINY
    first = initial * density[:, 0]
    total = first.sum(axis=-1, keepdims=True)
    steps = transition * density[:, 1:, None, :]
    forward, log_scale = _forward(first / total, steps)
    backward = _backward(steps)
    posterior = forward * backward
    posterior /= posterior.sum(axis=-1, keepdims=True)
    log_likelihood = highest[..., 0].sum(axis=1) + np.log(total[:, 0]) + log_scale
    return Smoothed(posterior, forward, backward, log_likelihood)


def _blocks(steps: Float) -> Float:
    """(L, K, K, B, n): the steps of n blocks side by side, filled up with identities; long axes last, for speed."""
    batch, count, k, _ = steps.shape
    length = max(1, int(np.ceil(np.sqrt(count))))
    blocks = max(1, -(-count // length))
    filled = np.empty((batch, blocks * length, k, k))
    filled[:, :count], filled[:, count:] = steps, np.eye(k)
    return np.ascontiguousarray(filled.reshape(batch, blocks, length, k, k).transpose(2, 3, 4, 0, 1))


def _product(a: Float, b: Float) -> Float:
    """Matrix product over the first two axes (..., K, K, B, n) of both, all others side by side."""
    result: Float = a[..., :, 0, None, :, :] * b[..., None, 0, :, :, :]
    for j in range(1, b.shape[-4]):
        result += a[..., :, j, None, :, :] * b[..., None, j, :, :, :]
    return result


def _forward(first: Float, steps: Float) -> tuple[Float, Float]:
    blocks = _blocks(steps)
    length, k, _, batch, count = blocks.shape
    scale = np.zeros((batch, count))
    for i in range(length):
        if i:
            blocks[i] = _product(blocks[i - 1], blocks[i])
        size = blocks[i].max(axis=(0, 1))
        blocks[i] /= size
        scale += np.log(size)
    carry, log_scale = np.ascontiguousarray(first.T), np.zeros(batch)
    starts = np.empty((k, batch, count))
    for i in range(count):
        starts[:, :, i] = carry
        carry = (carry[:, None] * blocks[-1, :, :, :, i]).sum(axis=0)
        total = carry.sum(axis=0)
        log_scale += scale[:, i] + np.log(total)
        carry = carry / total
    inside = _product(starts[None], blocks)[:, 0]
    inside = inside.transpose(2, 3, 0, 1).reshape(batch, -1, k)[:, : steps.shape[1]]
    inside /= inside.sum(axis=-1, keepdims=True)
    return np.concatenate([first[:, None], inside], axis=1), log_scale


def _backward(steps: Float) -> Float:
    """The forward pass of the reversed chain: its steps are the transposes in reversed order."""
    batch, _, k, _ = steps.shape
    ones = np.full((batch, k), 1.0 / k)
    turned, _ = _forward(ones, np.swapaxes(steps, -1, -2)[:, ::-1])
    return turned[:, ::-1]


def pairs(smoothed: Smoothed, emission: Float, transition: Float) -> Float:
    """(B, T - 1, K, K) p(phase i at t - 1, phase j at t | all windows)."""
    density = np.exp(emission - emission.max(axis=-1, keepdims=True)) + TINY
    ahead = density[:, 1:] * smoothed.backward[:, 1:]
    joint: Float = smoothed.forward[:, :-1, :, None] * transition * ahead[:, :, None, :]
    joint /= joint.sum(axis=(-2, -1), keepdims=True)
    return joint


def most_likely_path(initial: Float, emission: Float, transition: Float) -> NDArray[np.intp]:
    """Viterbi path (T,) of one demonstration: emission (T, K) logs, transition (T - 1, K, K) probabilities."""
    log_steps = np.log(transition + TINY)
    score = np.log(initial + TINY) + emission[0]
    back = np.empty((len(emission), len(score)), dtype=np.intp)
    for t in range(1, len(emission)):
        arriving = score[:, None] + log_steps[t - 1]
        back[t] = arriving.argmax(axis=0)
        score = arriving.max(axis=0) + emission[t]
    path = np.empty(len(emission), dtype=np.intp)
    path[-1] = score.argmax()
    for t in range(len(emission) - 1, 0, -1):
        path[t - 1] = back[t, path[t]]
    return path
