r"""Forward and backward probabilities of a Markov chain with time-dependent transitions, in blocks.

    alpha_t = alpha_{t-1} A_t,    beta_{t-1} = A_t beta_t,    A_t(i, j) = P_t(i, j) b_t(j)

Products of the K x K matrices A_t are taken in about sqrt(T) blocks, for all demonstrations and both directions at
once, instead of a slow loop; a vector passes between blocks. Rescaling prevents underflow. The most likely path takes
sums of logs and maxima. Time is the last axis inside, where numpy is fast.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

TINY = 1e-300
EVERY = 8  # products between two rescalings: a step shrinks by 1e-13 at most in practice, doubles reach 1e-308


class Smoothed(NamedTuple):
    """Probabilities of B demonstrations, T windows, K phases.

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
        emission: (B, T, K) log densities; 0 in padding windows.
        transition: (B, T - 1, K, K); identity into padding windows.
    """
    batch, _, k = emission.shape
    density, highest = _densities(emission)
    first = initial[:, None] * density[:, :, 0]
    total = first.sum(axis=0)
    steps = np.moveaxis(transition, (0, 1), (-2, -1)) * density[:, :, 1:]
    turned = np.swapaxes(steps, 0, 1)[..., ::-1]
    starts = np.concatenate([first / total, np.full((k, batch), 1.0 / k)], axis=1)
    passed, log_scale = _passed(starts, np.concatenate([steps, turned], axis=2))
    forward, backward = passed[:, :batch], passed[:, batch:, ::-1]
    posterior = forward * backward
    posterior /= posterior.sum(axis=0)
    log_likelihood = highest.sum(axis=1) + np.log(total) + log_scale[:batch]
    posterior, forward, backward = (np.moveaxis(x, 0, -1) for x in (posterior, forward, backward))
    return Smoothed(posterior, forward, backward, log_likelihood)


def _time_last(x: Float) -> Float:
    """(..., B, T) from (B, T, ...)."""
    return np.ascontiguousarray(np.moveaxis(x, (0, 1), (-2, -1)))


def _densities(emission: Float) -> tuple[Float, Float]:
    """Densities (K, B, T) over the highest of each window, and the log of the highest (B, T)."""
    logs = _time_last(emission)
    highest = logs.max(axis=0)
    return np.exp(logs - highest) + TINY, highest


def _blocks(steps: Float, neutral: Float) -> Float:
    """(L, K, K, B, n) steps (K, K, B, T) in n blocks, padded with neutral steps (K, K)."""
    k, _, batch, count = steps.shape
    length = max(1, int(np.ceil(np.sqrt(count))))
    blocks = max(1, -(-count // length))
    filled = np.empty((k, k, batch, blocks * length))
    filled[..., :count], filled[..., count:] = steps, neutral[:, :, None, None]
    return np.ascontiguousarray(np.moveaxis(filled.reshape(k, k, batch, blocks, length), -1, 0))


def _product(a: Float, b: Float) -> Float:
    """Matrix product over the first two axes (K, K, B, n)."""
    result: Float = a[:, 0, None] * b[None, 0]
    for j in range(1, len(b)):
        result += a[:, j, None] * b[None, j]
    return result


def _best(a: Float, b: Float) -> Float:
    result: Float = a[:, 0, None] + b[None, 0]
    for j in range(1, len(b)):
        np.maximum(result, a[:, j, None] + b[None, j], out=result)
    return result


def _applied(starts: Float, blocks: Float, apply: Callable[[Float, Float], Float], count: int) -> Float:
    """(K, B, count) vectors inside blocks of `count` steps, from (K, B, n) at their starts."""
    inside = apply(starts[None, ..., None], np.moveaxis(blocks, 0, -1))[0]
    result: Float = inside.reshape(*inside.shape[:2], -1)[..., :count]
    return result


def _passed(first: Float, steps: Float) -> tuple[Float, Float]:
    """Normalised vectors (K, B, T + 1) from `first` (K, B), and the log of their divisors (B,)."""
    blocks = _blocks(steps, np.eye(len(first)))
    length, _, _, batch, count = blocks.shape
    log_scale = np.zeros((batch, count))
    for i in range(length):
        if i:
            blocks[i] = _product(blocks[i - 1], blocks[i])
        if i % EVERY == EVERY - 1 or i == length - 1:
            size = blocks[i].max(axis=(0, 1))
            blocks[i] /= size
            log_scale += np.log(size)
    starts, handed = _handed(first, blocks[-1])
    inside = _applied(starts, blocks, _product, steps.shape[-1])
    inside /= inside.sum(axis=0)
    return np.concatenate([first[..., None], inside], axis=-1), log_scale.sum(axis=1) + handed


def _handed(first: Float, across: Float) -> tuple[Float, Float]:
    """Vectors (K, B, n) at the starts of blocks with products (K, K, B, n), and logs of the divisors (B,)."""
    matrices = np.ascontiguousarray(across.transpose(3, 2, 0, 1))
    carry = np.ascontiguousarray(first.T)[:, None]
    starts = np.empty((len(matrices), *carry.shape))
    totals = np.ones((len(matrices), len(carry), 1, 1))
    for i, matrix in enumerate(matrices):
        starts[i] = carry
        carry = carry @ matrix
        if i % EVERY == EVERY - 1 or i == len(matrices) - 1:
            totals[i] = carry.sum(axis=-1, keepdims=True)
            carry /= totals[i]
    return np.ascontiguousarray(starts[:, :, 0].transpose(2, 1, 0)), np.log(totals[:, :, 0, 0]).sum(axis=0)


def pairs(smoothed: Smoothed, emission: Float, transition: Float) -> Float:
    """(B, T - 1, K, K) p(phase i at t - 1, phase j at t | all windows)."""
    density, _ = _densities(emission)
    ahead = density[:, :, 1:] * np.moveaxis(smoothed.backward, -1, 0)[:, :, 1:]
    steps = np.moveaxis(transition, (0, 1), (-2, -1))
    joint = np.moveaxis(smoothed.forward, -1, 0)[:, None, :, :-1] * steps * ahead
    joint /= joint.sum(axis=(0, 1))
    return np.moveaxis(joint, (0, 1), (-2, -1))


def most_likely_path(initial: Float, emission: Float, transition: Float) -> NDArray[np.intp]:
    """Viterbi path (T,) of one demonstration: emission (T, K) logs, transition (T - 1, K, K) probabilities."""
    score = (np.log(initial + TINY) + emission[0])[:, None]
    logs = _time_last(np.log(transition + TINY)[None])
    steps = logs + emission[None, 1:].transpose(2, 0, 1)
    blocks = _blocks(steps, np.log(np.eye(len(initial)) + TINY))
    for i in range(1, len(blocks)):
        blocks[i] = _best(blocks[i - 1], blocks[i])
    starts = np.empty((*score.shape, blocks.shape[-1]))
    for i in range(blocks.shape[-1]):
        starts[..., i] = score
        score = _best(score[None], blocks[-1, ..., i])[0]
    scores = np.concatenate([starts[..., :1], _applied(starts, blocks, _best, steps.shape[-1])], axis=-1)
    back = (scores[:, None, 0, :-1] + logs[:, :, 0]).argmax(axis=0).T.tolist()
    path = [int(scores[:, 0, -1].argmax())]
    for before in reversed(back):
        path.append(before[path[-1]])
    return np.array(path[::-1], dtype=np.intp)
