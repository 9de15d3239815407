"""How soon a load that has landed must be pushed at to stay: a lumped calculation, no controller in it.

    m x'' = p(t) - f,    f = K x + c x' >= 0,    c = 2 zeta sqrt(K m_plate)

m is the load at the tool, x > 0 below the surface; it lands with x' = v. The push p grows steadily from an onset on up
to what f was at the impact, behind a valve of first order, and by the impedance's own K v from the touch on.

That it has landed shows in how far it stays behind, d = v t - x, in the encoder of the boom and as d k_oil in the
pressures of the lift cylinder. With sums over the samples since the touch a matched filter's signal over noise is

    s^2 = sum (d / (reach sigma_encoder))^2 + sum (d k_oil / sigma_oil)^2
"""

import numpy as np

LOAD, PLATE, RATIO = 700.0, 40.0, 0.5  # kg, kg
LANDING, STIFFNESS, VALVE_S = 0.05, 1e5, 0.012  # m/s; N/m of the impedance; 1/e time of a spool of 30 Hz with its slew
STEP_S, WATCHED_S, SAMPLE_S = 2e-5, 0.2, 1e-3
REACH, ENCODER, PRESSURE, SURE = 3.3, 1e-4, 0.22e5, 5.0  # m, rad, Pa; a false alarm in an hour of samples at 1 kHz
AREAS, VOLUMES, BULK, MODE_HZ = (5.03e-3, 3.44e-3), (4.5e-3, 4.0e-3), 8e8, 1.4  # of the lift cylinder at mid stroke


def stays(surface, onset, rate):
    """Whether the load never leaves a surface [N/m] with a push from `onset` [s] on that grows by `rate` [N/s]."""
    damper, most = 2.0 * RATIO * np.sqrt(surface * PLATE), LANDING * np.sqrt(surface * LOAD)
    depth, speed, push = 0.0, LANDING, 0.0
    for time in np.arange(0.0, WATCHED_S, STEP_S):
        wanted = np.clip((time - onset) * rate, 0.0, most)
        push += STEP_S / VALVE_S * (wanted - push)
        force = surface * depth + damper * speed
        if force < 0.0:
            return False
        speed += STEP_S / LOAD * (push + STIFFNESS * LANDING * time - force)
        depth += STEP_S * speed
    return True


def latest(surface, rate):
    """Latest onset [s] in steps of a millisecond with which the load stays; None if none does."""
    onsets = [onset for onset in np.arange(0.0, 0.06, 1e-3) if stays(surface, onset, rate)]
    return max(onsets, default=None)


def shown_after(surface):
    """Time after the touch [s] at which the sensors can tell it from noise, if all else is known exactly."""
    oil = LOAD * (2.0 * np.pi * MODE_HZ) ** 2
    lever = np.sqrt(oil / sum(BULK * a**2 / v for a, v in zip(AREAS, VOLUMES, strict=True)))
    noise = np.array([REACH * ENCODER, lever * PRESSURE * np.hypot(*AREAS) / oil])
    natural = np.sqrt(surface / LOAD)
    time = np.arange(0.0, WATCHED_S, SAMPLE_S)
    behind = LANDING * (time - np.sin(natural * time) / natural)
    signal = np.sqrt(np.cumsum(((behind[:, None] / noise) ** 2).sum(axis=1)))
    return float(time[np.argmax(signal > SURE)])
