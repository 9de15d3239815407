/* What cannot be meant is refused with a sentence: parameters before the start, motion outside the stroke. */
#ifndef SKILLFRAME_CHECKS_H
#define SKILLFRAME_CHECKS_H

#include <stdio.h>

#include "model.h"

#define REPORT(...) (snprintf(r->text, sizeof r->text, __VA_ARGS__))

static inline Outcome check_position(const Model *m, double x, Report *r)
{
    if (m->value[DISPLACEMENT] > 0.0) return OK;   /* a motor turns without end */
    double slack = fmin(0.02 + 0.02 * m->value[STROKE],
                        0.5 * fmin(m->value[DEAD_VOLUME_A] / m->own.area_a, m->value[DEAD_VOLUME_B] / m->own.area_b));
    if (x >= -slack && x <= m->value[STROKE] + slack) return OK;
    REPORT("position %.4g m is outside the stroke 0 to %.4g m by more than %.3g m; check the start pose and the end stops",
           x, m->value[STROKE], slack);
    return DISCARD;
}

static inline Outcome require(int fine, const char *name, const char *rule, double value, Report *r)
{
    if (fine) return OK;
    REPORT("parameter %s is %g; it must be %s", name, value, rule);
    return FAILED;
}

#define POSITIVE(i) require(v[i] > 0.0, VARIABLES[i].name, "greater than zero", v[i], r)
#define NOT_NEGATIVE(i) require(v[i] >= 0.0, VARIABLES[i].name, "zero or more", v[i], r)

/* Points of the opening: from no opening to (1, 1), rising. */
static inline Outcome check_opening(const Model *m, Report *r)
{
    const double *v = m->value;
    int count = (int)v[OPENING_POINTS], last = count - 1;
    Outcome out = require(v[OPENING_POINTS] == count && count >= 2 && count <= 8, "opening_points", "0, or 2 to 8", v[OPENING_POINTS], r);
    if (out == OK) out = require(v[DEADBAND] == 0.0, "deadband", "0 beside opening_points, whose first one is the overlap", v[DEADBAND], r);
    if (out == OK) out = require(v[OPENING_1] == 0.0, "opening_1", "0", v[OPENING_1], r);
    if (out == OK) out = require(v[TRAVEL_1] >= 0.0, "travel_1", "zero or more", v[TRAVEL_1], r);
    for (int i = 0; i < last && out == OK; i++) {
        out = require(v[TRAVELS[i + 1]] > v[TRAVELS[i]], VARIABLES[TRAVELS[i + 1]].name, "above that of the point before", v[TRAVELS[i + 1]], r);
        if (out == OK)
            out = require(v[OPENINGS[i + 1]] > v[OPENINGS[i]], VARIABLES[OPENINGS[i + 1]].name, "above that of the point before", v[OPENINGS[i + 1]], r);
    }
    if (out == OK) out = require(v[TRAVELS[last]] == 1.0, VARIABLES[TRAVELS[last]].name, "1 at the last point", v[TRAVELS[last]], r);
    if (out == OK) out = require(v[OPENINGS[last]] == 1.0, VARIABLES[OPENINGS[last]].name, "1 at the last point", v[OPENINGS[last]], r);
    return out;
}

static inline Outcome check_parameters(const Model *m, Report *r)
{
    static const int positive[] = {BORE, STROKE, DEAD_VOLUME_A, DEAD_VOLUME_B, BULK_MODULUS, RATED_FLOW,
                                   RATED_PRESSURE_DROP, EDGE_PA, EDGE_PB, EDGE_AT, EDGE_BT, SPOOL_FREQUENCY, SPOOL_DAMPING, LAMINAR_PRESSURE,
                                   STRIBECK_VELOCITY, PRESLIDING_LENGTH, CUSHION_FLOW, PILOT_RATIO, COUNTERBALANCE_FLOW, COUNTERBALANCE_DROP, COUNTERBALANCE_RANGE,
                                   SUBSTEP, TOLERANCE};
    static const int not_negative[] = {DISPLACEMENT, ROD, BULK_MODULUS_SLOPE, AIR_FRACTION, SPOOL_SLEW, DEADBAND, HYSTERESIS, LEAKAGE,
                                       COULOMB_FRICTION, VISCOUS_FRICTION, STATIC_FRICTION,
                                       ENDSTOP_STIFFNESS, ENDSTOP_DAMPING, CUSHION_LENGTH, RELIEF_CONDUCTANCE,
                                       CHECK_CONDUCTANCE, COUNTERBALANCE_A, COUNTERBALANCE_B};
    const double *v = m->value;
    Outcome out = OK;
    for (size_t i = 0; i < sizeof positive / sizeof *positive && out == OK; i++) out = POSITIVE(positive[i]);
    for (size_t i = 0; i < sizeof not_negative / sizeof *not_negative && out == OK; i++)
        out = NOT_NEGATIVE(not_negative[i]);
    if (out == OK) out = require(v[ROD] < v[BORE], "rod", "smaller than bore", v[ROD], r);
    if (out == OK) out = require(v[AIR_FRACTION] < 0.5, "air_fraction", "below 0.5", v[AIR_FRACTION], r);
    if (out == OK) out = require(v[DEADBAND] < 1.0, "deadband", "below 1", v[DEADBAND], r);
    if (out == OK && v[OPENING_POINTS] != 0.0) out = check_opening(m, r);
    if (out == OK)
        out = require(v[COUNTERBALANCE_A] == 0.0 || v[COUNTERBALANCE_B] == 0.0, "counterbalance_b",
                      "0 beside counterbalance_a: a cylinder has one counterbalance valve", v[COUNTERBALANCE_B], r);
    if (out == OK) out = require(v[SUBSTEP] >= 1e-6, "substep", "at least 1e-6 s", v[SUBSTEP], r);
    if (out == OK)
        out = require(v[SUPPLY_PRESSURE] > v[RETURN_PRESSURE], "supply_pressure", "above return_pressure",
                      v[SUPPLY_PRESSURE], r);
    return out;
}

#endif
