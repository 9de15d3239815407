/* Oil, edges, spool and seals: closed forms, each with its derivative. Equations and sources: README.md. */
#ifndef SKILLFRAME_PHYSICS_H
#define SKILLFRAME_PHYSICS_H

#include <math.h>

#define AMBIENT 101325.0      /* Pa */
#define POLYTROPIC 1.4        /* entrained air is compressed without heat exchange */
#define HOLE 0.0325           /* 0.67 sqrt(2 / (850 kg/m3)), flow through a sharp hole per area and sqrt(Pa) */
#define LEAST_ABSOLUTE 100.0  /* Pa, keeps the air law finite when a chamber is torn empty */
#define VAPOUR (-0.9e5)       /* Pa gauge, below which oil begins to boil, README eq. 4 */
#define BOILING 0.1e5         /* Pa, and so much further down it bears no more */

typedef struct { double y, slope; } Curve;

/* Share of a falling pressure's rate that is left as the oil boils, README eq. 4; 1 while it does not. */
static inline Curve boiling_law(double p, double net)
{
    Curve c = {1.0, 0.0};
    if (p >= VAPOUR || net >= 0.0) return c;
    c.y = 1.0 + (p - VAPOUR) / BOILING, c.slope = 1.0 / BOILING;
    if (c.y < 0.0) c.y = c.slope = 0.0;
    return c;
}

/* Edge flow per sqrt-conductance, dp / (dp^2 + transition^2)^(1/4), README eq. 3. */
static inline Curve edge_law(double dp, double transition)
{
    double square = dp * dp + transition * transition, root = sqrt(square), quarter = sqrt(root);
    Curve c = {dp / quarter, (square - 0.5 * dp * dp) / (square * quarter)};
    return c;
}

/* Effective bulk modulus of oil with undissolved air and its pressure derivative, README eq. 5. */
static inline Curve bulk_law(double p, double oil, double oil_slope, double air)
{
    double stiff = oil + oil_slope * p;
    if (air <= 0.0) {
        Curve pure = {stiff, oil_slope};
        return pure;
    }
    double absolute = p + AMBIENT > LEAST_ABSOLUTE ? p + AMBIENT : LEAST_ABSOLUTE;
    double ratio = pow(AMBIENT / absolute, 1.0 / POLYTROPIC), springy = 1.0 / (POLYTROPIC * absolute);
    double volume = 1.0 - air + air * ratio, softness = (1.0 - air) / stiff + air * ratio * springy;
    double volume_slope = -air * ratio * springy;
    double softness_slope = -(1.0 - air) * oil_slope / (stiff * stiff)
                            - air * ratio * springy * (springy + 1.0 / absolute);
    Curve c = {volume / softness, (volume_slope * softness - volume * softness_slope) / (softness * softness)};
    return c;
}

typedef struct { double x, v; } Spool;

/* Second-order spool after time t under a command that starts at u and grows by `ramp` per second: exact, README eq. 2. */
static inline Spool spool_after(Spool s, double u, double ramp, double t, double omega, double damping)
{
    double lag = u - 2.0 * damping * ramp / omega, d = s.x - lag, e = s.v - ramp;
    double decay = damping * omega, split = damping * damping - 1.0, wave = omega * sqrt(fabs(split));
    double cosine, sine;   /* both times exp(-decay t); sine divided by wave */
    if (wave * t < 1e-5) {
        double fade = exp(-decay * t);
        cosine = fade, sine = fade * t;
    } else if (split < 0.0) {
        double fade = exp(-decay * t);
        cosine = fade * cos(wave * t), sine = fade * sin(wave * t) / wave;
    } else {
        double slow = exp((wave - decay) * t), fast = exp(-(wave + decay) * t);
        cosine = 0.5 * (slow + fast), sine = 0.5 * (slow - fast) / wave;
    }
    Spool after = {lag + ramp * t + d * (cosine + decay * sine) + e * sine,
                   ramp + e * (cosine - decay * sine) - omega * omega * d * sine};
    return after;
}

/* Deflection at which the seals slide steadily at speed v, README eq. 8. */
static inline double sliding_deflection(double v, double length, double coulomb, double breakaway, double stribeck)
{
    if (breakaway <= coulomb || coulomb <= 0.0) return length;
    double s = v / stribeck;
    return length * (1.0 + (breakaway / coulomb - 1.0) * exp(-s * s));
}

typedef struct { double z, integral, work; } Slide;   /* deflection, its integral over time, and over the path */

/* Sliding for h without reversal at mean speed v towards the deflection `limit` (positive). Exact for a constant limit,
 * but for the integral over time, which takes the speed as constant (README, "Integration"). */
static inline Slide slide(double z, double v, double h, double limit)
{
    double goal = v < 0.0 ? -limit : limit, way = fabs(v) * h / limit, fade = expm1(-way);
    double mean = way > 1e-6 ? -fade / way : 1.0 - 0.5 * way;
    double after = z - (goal - z) * fade;
    Slide s = {after, h * (goal + (z - goal) * mean), goal * (v * h - (after - z))};
    return s;
}

static inline double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

#endif
