/* Pressure build-up in the two chambers and the supply line, with exact derivatives for the integrator (README eq. 4). */
#ifndef SKILLFRAME_CHAMBERS_H
#define SKILLFRAME_CHAMBERS_H

#include "model.h"
#include "physics.h"

enum { A, B, S };   /* chamber a, chamber b, supply line */

typedef struct {
    double position, velocity, acceleration;
    Spool spool;
} Motion;

typedef struct {
    double rate[3], jacobian[3][3], drift[3];   /* dp/dt, its derivative by p, and by time at constant p */
    double flow_a, flow_b, flow_supply;
} Chambers;

/* Flow through one open edge, from the side of higher `dp` on; all derivatives. */
typedef struct { double flow, by_dp, by_time; } Edge;

static inline Edge through_edge(const Model *m, double opening, double opening_rate, double dp, double closing,
                                double closing_rate)
{
    double c = m->own.edge * opening, c_rate = m->own.edge * opening_rate;
    if (closing > 0.0 && dp > 0.0) {   /* in series with the cushion's throttle, README eq. 6 */
        double q = c * closing / m->own.cushion, bend = 1.0 / ((1.0 + q * q) * sqrt(1.0 + q * q));
        c_rate = bend * (c_rate - c * q * c / m->own.cushion * closing_rate);
        c /= sqrt(1.0 + q * q);
    }
    Curve law = edge_law(dp, m->value[LAMINAR_PRESSURE]);
    Edge e = {c * law.y, c * law.slope, c_rate * law.y};
    return e;
}

/* How far the cushion of an end has closed (0 open, 1 at the end) and its rate; `room` is the way left to that end. */
static inline void cushion_of(const Model *m, double room, double room_rate, double *closing, double *rate)
{
    double length = m->value[CUSHION_LENGTH];
    *closing = length > 0.0 ? clip(1.0 - room / length, 0.0, 1.0) : 0.0;
    *rate = *closing > 0.0 && *closing < 1.0 ? -room_rate / length : 0.0;
}

/* Valve flows into the chambers and their derivatives; `into` rows are chambers, columns the three pressures. */
static inline void valve(const Model *m, const Motion *w, const double p[3], Chambers *c, double by[2][3], double drift[2])
{
    const double *v = m->value;
    double x = clip(w->spool.x, -1.0, 1.0), travel = 1.0 - v[DEADBAND];
    double open = fabs(x) > v[DEADBAND] ? (fabs(x) - v[DEADBAND]) / travel : 0.0;
    double rate = open > 0.0 && fabs(w->spool.x) <= 1.0 ? (x > 0.0 ? w->spool.v : -w->spool.v) / travel : 0.0;
    double closing, closing_rate;
    int feeds = x > 0.0 ? A : B, drains = x > 0.0 ? B : A;
    c->flow_a = c->flow_b = c->flow_supply = 0.0;
    if (open <= 0.0) return;
    Edge in = through_edge(m, open, rate, p[S] - v[SUPPLY_DROP] - p[feeds], 0.0, 0.0);
    double room = drains == A ? w->position : v[STROKE] - w->position;
    cushion_of(m, room, drains == A ? w->velocity : -w->velocity, &closing, &closing_rate);
    Edge out = through_edge(m, open, rate, p[drains] - v[RETURN_PRESSURE], closing, closing_rate);
    by[feeds][feeds] -= in.by_dp, by[feeds][S] += in.by_dp, drift[feeds] += in.by_time;
    by[drains][drains] -= out.by_dp, drift[drains] -= out.by_time;
    c->flow_a = feeds == A ? in.flow : -out.flow;
    c->flow_b = feeds == B ? in.flow : -out.flow;
    c->flow_supply = in.flow;
}

/* Port relief to the return line and anti-cavitation check from it, README eq. 7. */
static inline double ports(const double *v, double p, double *slope)
{
    double over = p - v[RELIEF_PRESSURE], under = v[RETURN_PRESSURE] - p;
    if (over > 0.0) { *slope -= v[RELIEF_CONDUCTANCE]; return -v[RELIEF_CONDUCTANCE] * over; }
    if (under > 0.0) { *slope -= v[CHECK_CONDUCTANCE]; return v[CHECK_CONDUCTANCE] * under; }
    return 0.0;
}

/* Out of a hose with a hole of this area, README eq. 11; back in where the chamber is below ambient. */
static inline double burst(const double *v, double area, double p, double *slope)
{
    if (!(area > 0.0)) return 0.0;
    Curve law = edge_law(p, v[LAMINAR_PRESSURE]);
    *slope -= area * HOLE * law.slope;
    return -area * HOLE * law.y;
}

static inline void supply_line(const Model *m, const double p[3], Chambers *c, const double by[2][3],
                               const double drift[2], int feeds)
{
    const double *v = m->value;
    double wanted = m->own.pump_slope * (v[SUPPLY_PRESSURE] - p[S]), limited = wanted > v[PUMP_FLOW];
    double gain = v[BULK_MODULUS] / v[SUPPLY_VOLUME];
    c->rate[S] = gain * ((limited ? v[PUMP_FLOW] : wanted) - c->flow_supply - v[OTHER_FLOW]);
    for (int j = 0; j < 3; j++) c->jacobian[S][j] = feeds < 0 ? 0.0 : -gain * by[feeds][j];
    c->jacobian[S][S] -= limited ? 0.0 : gain * m->own.pump_slope;
    c->drift[S] = feeds < 0 ? 0.0 : -gain * drift[feeds];
}

static inline void chambers(const Model *m, const Motion *w, const double p[3], Chambers *c)
{
    const double *v = m->value;
    double by[2][3] = {{0}}, drift[2] = {0}, edges[2][3], edge_drift[2];
    const double area[2] = {m->own.area_a, -m->own.area_b};
    const double volume[2] = {v[DEAD_VOLUME_A] + m->own.area_a * w->position,
                              v[DEAD_VOLUME_B] + m->own.area_b * (v[STROKE] - w->position)};
    valve(m, w, p, c, by, drift);
    for (int i = A; i <= B; i++) {
        for (int j = 0; j < 3; j++) edges[i][j] = by[i][j];
        edge_drift[i] = drift[i];
    }
    double leak = v[LEAKAGE] * (p[A] - p[B]);
    for (int i = A; i <= B; i++) {
        double sign = i == A ? 1.0 : -1.0, net = (i == A ? c->flow_a : c->flow_b) - sign * leak;
        net += ports(v, p[i], &by[i][i]) - area[i] * w->velocity;
        net += burst(v, i == A ? v[BURST_A] : v[BURST_B], p[i], &by[i][i]);
        by[i][i] -= v[LEAKAGE], by[i][1 - i] += v[LEAKAGE];
        Curve bulk = bulk_law(p[i], v[BULK_MODULUS], v[BULK_MODULUS_SLOPE], v[AIR_FRACTION]);
        double gain = bulk.y / volume[i];
        c->rate[i] = gain * net;
        for (int j = 0; j < 3; j++) c->jacobian[i][j] = gain * by[i][j];
        c->jacobian[i][i] += bulk.slope / volume[i] * net;
        c->drift[i] = gain * (drift[i] - area[i] * w->acceleration - net * area[i] * w->velocity / volume[i]);
        Curve left = boiling_law(p[i], net);
        if (left.y < 1.0) {
            for (int j = 0; j < 3; j++) c->jacobian[i][j] *= left.y;
            c->jacobian[i][i] += left.slope * c->rate[i];
            c->rate[i] *= left.y, c->drift[i] *= left.y;
        }
    }
    c->rate[S] = c->drift[S] = c->jacobian[S][A] = c->jacobian[S][B] = c->jacobian[S][S] = 0.0;
    if (v[PUMP_FLOW] > 0.0)
        supply_line(m, p, c, edges, edge_drift, c->flow_supply == 0.0 ? -1 : w->spool.x > 0.0 ? A : B);
}

#endif
