"""Thresholds of audits and proposals: what a figure of a recording must exceed before it is reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditThresholds:
    """Thresholds of an audit's warnings.

    Attributes:
        path_m, turn_rad: smallest motion to learn from.
        far_m: farthest position; nothing that holds a tool reaches so far.
        force_n, lever_m: largest force, and largest typical torque over force; larger ones have another unit.
        held_steps: fewest steps of a held pose or wrench that give its rate.
        spike_sigmas, spike_n: robust standard deviations, and force, above the median of nine samples.
        level_rows: samples before a spike that give the force level.
        level_s: time of a force level beside a spike.
        level_change_n, level_change: change of the level that makes a spike real; the second as a share of the peak.
        resolved: samples above half of the peak that make a spike real.
        core, flank, flank_sigmas: of a landing, share of the peak in its core, least share of a flank, and its least
            standard deviations of the force.
        velocity_s: time over which a velocity is fitted.
        approach_m_s, stopped, sure: least approach of a landing, lost share of it, and their standard deviations.
        point_turn_rad: rotation below which quaternion orders look alike.
        contact_n, torque_nm: least force, and least change of the torque, that separate quaternion orders.
        order_ratio: residual of the order as read over that of the other.
        tared_turn_rad, tared_n, tared_left: rotation, weight, and remaining share of the force of a tared weight.
        late_rate_hz: samples per second that are compared for a delay.
        late_span: shifts to each side [samples at that rate].
        late_s, late_gain: least delay that counts, and the share of the peak that it must lose unshifted.
        late_duration_s: shortest recording; shorter ones have too few events.
        late_clip: quantile of the changes at which they are clipped, so that no single event decides.
        late_speed_m_s: speed below which the direction of motion fades out.
        late_height, late_width_s, late_narrow: least height of the peak, largest width, and least width in recorded
            samples; interpolation makes narrower ones.
        late_away_s, late_second: distance from the peak at which everything is lower than this share of it.
        late_edge, late_halves: samples at the ends without a peak, and largest offset of the halves' peaks.
        slow_hz, fast_hz, gaps: plausible rates, and largest ratio of duration to samples times period.
    """

    path_m: float = 1e-4
    turn_rad: float = float(np.deg2rad(0.1))
    far_m: float = 20.0
    force_n: float = 2e4
    lever_m: float = 3.0
    held_steps: int = 10
    spike_sigmas: float = 12.0
    spike_n: float = 5.0
    level_rows: int = 9
    level_s: float = 0.1
    level_change_n: float = 1.0
    level_change: float = 0.2
    resolved: int = 3
    core: float = 0.6
    flank: float = 0.1
    flank_sigmas: float = 3.0
    velocity_s: float = 0.03
    approach_m_s: float = 0.005
    stopped: float = 0.25
    sure: float = 3.0
    point_turn_rad: float = float(np.deg2rad(10.0))
    contact_n: float = 1.0
    torque_nm: float = 0.02
    order_ratio: float = 1.3
    tared_turn_rad: float = float(np.deg2rad(20.0))
    tared_n: float = 1.0
    tared_left: float = 1.0 / 3.0
    late_rate_hz: float = 50.0
    late_span: int = 35
    late_s: float = 0.03
    late_gain: float = 0.1
    late_duration_s: float = 4.0
    late_clip: float = 0.98
    late_speed_m_s: float = 0.01
    late_height: float = 0.25
    late_width_s: float = 0.4
    late_narrow: float = 0.9
    late_away_s: float = 0.25
    late_second: float = 0.6
    late_edge: int = 5
    late_halves: int = 3
    slow_hz: float = 5.0
    fast_hz: float = 2e4
    gaps: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposalThresholds:
    """Thresholds of a proposed layout.

    Attributes:
        same_rad: angle below which two formats give the same orientation.
        spin_left, gravity_left: largest residuals of angular velocity and gravity that confirm a format, as shares.
        better: ratio of the next format's residual to the best one's.
        norm: largest deviation of a quaternion's norm, or of a matrix from a rotation.
        norm_rows: share of rows in which it holds.
        slow_hz, fast_hz: plausible rates, which give the unit of time.
        reach, far: lengths beyond the reach of arms (at most 4.7 m) and of machines (long booms: 15 m).
        clock_runs: least share of rows in which a clock advances; loggers repeat stamps, and positions rest.
        smoother: factor in smoothness that identifies the pose.
        turn: largest angle in radians.
        like: relative tolerance of dp/dt over velocity for a unit.
        upright: cosine between a weight and the vertical; a force that leans more is no weight.
        pushed: share of |F||dx| that a passive environment can seem to do through levers, as real snaps show.
    """

    same_rad: float = float(np.deg2rad(1.0))
    spin_left: float = 0.3
    gravity_left: float = 0.2
    better: float = 2.0
    norm: float = 0.01
    norm_rows: float = 0.99
    slow_hz: float = 5.0
    fast_hz: float = 5000.0
    reach: float = 5.0
    far: float = 20.0
    clock_runs: float = 0.9
    smoother: float = 10.0
    turn: float = 2.0 * np.pi + 0.1
    like: float = 0.2
    upright: float = float(np.cos(np.deg2rad(30.0)))
    pushed: float = 0.2


AUDIT, PROPOSAL = AuditThresholds(), ProposalThresholds()
