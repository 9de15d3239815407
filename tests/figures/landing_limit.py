"""How soon a load that has landed must be pushed at to stay: a lumped calculation, no controller in it.

    m x'' = p(t) - f,    f = K x + c x' >= 0,    c = 2 zeta sqrt(K m_plate)
    p' = lever B (A_a Q_a / V_a + A_b Q_b / V_b) u + K_impedance v

m is the load at the tool, x > 0 below the surface; it lands with x' = v. From an onset on the lift cylinder's spool
goes to u (second order, slew), until p is the force of the impact; Q are the flows of the open valve at the pressures
that hold the crane at rest. The other cylinder, which could help, and the oil's own answer to the motion are left out.

That it has landed shows in how far it stays behind, d = v t - x, in the encoder of the boom and as d k_oil in the
pressures of the lift cylinder. With sums over the samples since the touch a matched filter's signal over noise is

    s^2 = sum (d / (reach sigma_encoder))^2 + sum (d k_oil / sigma_oil)^2
"""

import numpy as np

LOAD, PLATE, RATIO = 700.0, 40.0, 0.5  # kg, kg
LANDING, STIFFNESS = 0.05, 1e5  # m/s; N/m of the impedance
STEP_S, WATCHED_S, SAMPLE_S = 2e-5, 0.2, 1e-3
SPOOL_HZ, SPOOL_DAMPING, SLEW = 30.0, 0.707, 100.0  # 1/s
REACH, ENCODER, PRESSURE, SURE = 3.3, 1e-4, 0.22e5, 5.0  # m, rad, Pa; a false alarm in an hour of samples at 1 kHz
AREAS, VOLUMES, BULK, MODE_HZ = (5.03e-3, 3.44e-3), (4.5e-3, 4.0e-3), 8e8, 1.4  # of the lift cylinder at mid stroke
RATED_FLOW, RATED_DROP, DROPS = 100e-3 / 60.0, 70e5, (120e5, 159e5)  # of a to tank, of the supply to b [Pa]
OIL = LOAD * (2.0 * np.pi * MODE_HZ) ** 2  # N/m at the tool
LEVER = np.sqrt(OIL / sum(BULK * a**2 / v for a, v in zip(AREAS, VOLUMES, strict=True)))


def fastest():
    """Rate of the push [N/s] with the lift cylinder's valve fully open."""
    flows = [RATED_FLOW * np.sqrt(drop / RATED_DROP) for drop in DROPS]
    return LEVER * sum(BULK * a * q / v for a, q, v in zip(AREAS, flows, VOLUMES, strict=True))


def stays(surface, onset, opening):
    """Whether the load never leaves a surface [N/m] with the valve opened (0 to 1) from `onset` [s] on."""
    damper, most, rate = 2.0 * RATIO * np.sqrt(surface * PLATE), LANDING * np.sqrt(surface * LOAD), fastest()
    natural = 2.0 * np.pi * SPOOL_HZ
    depth, speed, push, spool, going = 0.0, LANDING, 0.0, 0.0, 0.0
    for time in np.arange(0.0, WATCHED_S, STEP_S):
        wanted = opening if time >= onset and push < most else 0.0
        going += STEP_S * natural * (natural * (wanted - spool) - 2.0 * SPOOL_DAMPING * going)
        spool += STEP_S * np.clip(going, -SLEW, SLEW)
        push += STEP_S * rate * spool
        force = surface * depth + damper * speed
        if force < 0.0:
            return False
        speed += STEP_S / LOAD * (push + STIFFNESS * LANDING * time - force)
        depth += STEP_S * speed
    return True


def latest(surface, opening):
    """Latest onset [s] in steps of a millisecond with which the load stays, or None if none does."""
    onsets = [onset for onset in np.arange(0.0, 0.06, 1e-3) if stays(surface, onset, opening)]
    return max(onsets, default=None)


def shown_after(surface, encoder=ENCODER):
    """Time after the touch [s] at which the sensors can tell it from noise, if all else is known exactly."""
    noise = np.array([REACH * encoder, LEVER * PRESSURE * np.hypot(*AREAS) / OIL])
    natural = np.sqrt(surface / LOAD)
    time = np.arange(0.0, WATCHED_S, SAMPLE_S)
    behind = LANDING * (time - np.sin(natural * time) / natural)
    signal = np.sqrt(np.cumsum(((behind[:, None] / noise) ** 2).sum(axis=1)))
    return float(time[np.argmax(signal > SURE)])
