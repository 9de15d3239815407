/* Pressure build-up in the two chambers, with exact derivatives for the integrator (README eq. 4). */
#ifndef SKILLFRAME_CHAMBERS_H
#define SKILLFRAME_CHAMBERS_H

#include "model.h"
#include "physics.h"

enum { A, B };   /* chambers */
static const int TRAVELS[8] = {TRAVEL_1, TRAVEL_2, TRAVEL_3, TRAVEL_4, TRAVEL_5, TRAVEL_6, TRAVEL_7, TRAVEL_8};
static const int OPENINGS[8] = {OPENING_1, OPENING_2, OPENING_3, OPENING_4, OPENING_5, OPENING_6, OPENING_7, OPENING_8};

typedef struct {
    double position, velocity, acceleration;
    Spool spool;
} Motion;

typedef struct {
    double rate[2], jacobian[2][2], drift[2];   /* dp/dt, its derivative by p, and by time at constant p */
    double flow_a, flow_b, flow_supply, supply_slope;
} Chambers;

/* A motor turns: its chambers keep their volumes, and it has no ends. */
static inline int is_motor(const Model *m) { return m->value[DISPLACEMENT] > 0.0; }

/* Conductance of the counterbalance valve at a chamber's port, and its derivatives; negative: no valve. README eq. 13. */
typedef struct { double open, by[2]; } Held;

static inline Held held_at(const Model *m, int at, const double p[2])
{
    const double *v = m->value;
    double setting = v[at == A ? COUNTERBALANCE_A : COUNTERBALANCE_B];
    Held h = {-1.0, {0.0, 0.0}};
    if (setting <= 0.0) return h;
    double lift = (p[at] + v[PILOT_RATIO] * p[1 - at] - setting) / v[COUNTERBALANCE_RANGE];
    h.open = m->own.counterbalance * clip(lift, 0.0, 1.0);
    if (lift > 0.0 && lift < 1.0) {
        h.by[at] = m->own.counterbalance / v[COUNTERBALANCE_RANGE];
        h.by[1 - at] = v[PILOT_RATIO] * h.by[at];
    }
    return h;
}

/* Flow through one open edge, from the side of higher `dp` on; all derivatives. */
typedef struct { double flow, by_dp, by_time, by_held; } Edge;

static inline Edge through_edge(const Model *m, double opening, double opening_rate, double dp, double closing,
                                double closing_rate, double held)
{
    double bent = 0.0;
    double c = m->own.edge * opening, c_rate = m->own.edge * opening_rate;
    if (closing > 0.0 && dp > 0.0) {   /* in series with the cushion's throttle, README eq. 6 */
        double q = c * closing / m->own.cushion, bend = 1.0 / ((1.0 + q * q) * sqrt(1.0 + q * q));
        c_rate = bend * (c_rate - c * q * c / m->own.cushion * closing_rate);
        c /= sqrt(1.0 + q * q);
    }
    if (held >= 0.0 && dp > 0.0) {   /* in series with the counterbalance valve, README eq. 13 */
        double q = c / held, bend = held > 0.0 ? 1.0 / sqrt(1.0 + q * q) : 0.0;
        c *= bend, c_rate *= bend * bend * bend;
        bent = held > 0.0 ? c / held * (c / held) * (c / held) : 0.0;
    }
    Curve law = edge_law(dp, m->value[LAMINAR_PRESSURE]);
    Edge e = {c * law.y, c * law.slope, c_rate * law.y, bent * law.y};
    return e;
}

/* How far the cushion of an end has closed (0 open, 1 at the end) and its rate; `room` is the way left to that end. */
static inline void cushion_of(const Model *m, double room, double room_rate, double *closing, double *rate)
{
    double length = is_motor(m) ? 0.0 : m->value[CUSHION_LENGTH];
    *closing = length > 0.0 ? clip(1.0 - room / length, 0.0, 1.0) : 0.0;
    *rate = *closing > 0.0 && *closing < 1.0 ? -room_rate / length : 0.0;
}

/* Opening of the edges at a travel of 0 to 1, and travel per opening there, README eq. 2. */
static inline double opening_at(const Model *m, double x, double *steep)
{
    const double *v = m->value;
    int last = (int)v[OPENING_POINTS] - 1, i = 0;
    if (last < 0) {
        *steep = 1.0 - v[DEADBAND];
        return x > v[DEADBAND] ? (x - v[DEADBAND]) / *steep : 0.0;
    }
    if (x <= v[TRAVELS[0]]) return 0.0;
    while (i < last - 1 && x > v[TRAVELS[i + 1]]) i++;
    *steep = (v[TRAVELS[i + 1]] - v[TRAVELS[i]]) / (v[OPENINGS[i + 1]] - v[OPENINGS[i]]);
    return v[OPENINGS[i]] + (x - v[TRAVELS[i]]) / *steep;
}

/* Valve flows into the chambers and their derivatives: rows of `by` are chambers, columns their pressures. */
static inline void valve(const Model *m, const Motion *w, const double p[2], Chambers *c, double by[2][2], double drift[2])
{
    const double *v = m->value;
    double x = clip(w->spool.x, -1.0, 1.0), steep = 1.0, open = opening_at(m, fabs(x), &steep);
    double rate = open > 0.0 && fabs(w->spool.x) <= 1.0 ? (x > 0.0 ? w->spool.v : -w->spool.v) / steep : 0.0;
    double closing, closing_rate;
    int feeds = x > 0.0 ? A : B, drains = x > 0.0 ? B : A;
    c->flow_a = c->flow_b = c->flow_supply = c->supply_slope = 0.0;
    if (open <= 0.0) return;
    double wide_in = v[feeds == A ? EDGE_PA : EDGE_PB], wide_out = v[drains == A ? EDGE_AT : EDGE_BT];
    const int kept = v[HELD_PRESSURE] > 0.0 && v[HELD_PRESSURE] > p[feeds];   /* by a compensator, README eq. 14 */
    double drop = v[SUPPLY_PRESSURE] - v[SUPPLY_DROP] - (kept ? v[HELD_PRESSURE] : p[feeds]);
    Edge in = {0.0, 0.0, 0.0, 0.0};
    if (drop >= 0.0 || (!kept && v[FEED_CHECK] == 0.0 && held_at(m, feeds, p).open < 0.0))
        in = through_edge(m, wide_in * open, wide_in * rate, drop, 0.0, 0.0, -1.0);
    double room = drains == A ? w->position : v[STROKE] - w->position;
    cushion_of(m, room, drains == A ? w->velocity : -w->velocity, &closing, &closing_rate);
    Held held = held_at(m, drains, p);
    Edge out = through_edge(m, wide_out * open, wide_out * rate, p[drains] - v[RETURN_PRESSURE], closing, closing_rate,
                            held.open);
    by[feeds][feeds] -= kept ? 0.0 : in.by_dp, drift[feeds] += in.by_time;
    if (held.open >= 0.0)
        for (int j = A; j <= B; j++) by[drains][j] -= out.by_held * held.by[j];
    by[drains][drains] -= out.by_dp, drift[drains] -= out.by_time;
    c->flow_a = feeds == A ? in.flow : -out.flow;
    c->flow_b = feeds == B ? in.flow : -out.flow;
    c->flow_supply = in.flow, c->supply_slope = in.by_dp;
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

/* Out of a hose before a counterbalance valve, README eq. 13: the spool's flow `fed` first, with its slope `fed_by`, then
 * what the valve passes. */
static inline double held_burst(const Model *m, int at, double area, const double p[2], double fed, double fed_by,
                                double by[2], double *drift)
{
    const double *v = m->value;
    Held held = held_at(m, at, p);
    if (!(area > 0.0) || held.open < 0.0 || p[at] <= 0.0) return burst(v, area, p[at], &by[at]);
    Curve law = edge_law(p[at], v[LAMINAR_PRESSURE]);
    if (fed >= area * HOLE * law.y) return burst(v, area, p[at], &by[at]);
    double q = area * HOLE / held.open, c = held.open > 0.0 ? area * HOLE / sqrt(1.0 + q * q) : 0.0;
    if (fed > c * law.y) {
        by[at] -= fed_by, *drift = 0.0;
        return -fed;
    }
    double bent = held.open > 0.0 ? c / held.open * (c / held.open) * (c / held.open) : 0.0;
    for (int j = A; j <= B; j++) by[j] -= bent * law.y * held.by[j];
    by[at] -= c * law.slope;
    return -c * law.y;
}

static inline void chambers(const Model *m, const Motion *w, const double p[2], Chambers *c)
{
    const double *v = m->value;
    double by[2][2] = {{0}}, drift[2] = {0};
    const double area[2] = {m->own.area_a, -m->own.area_b};
    const int turns = is_motor(m);
    const double volume[2] = {v[DEAD_VOLUME_A] + m->own.area_a * (turns ? 0.0 : w->position),
                              v[DEAD_VOLUME_B] + m->own.area_b * (turns ? 0.0 : v[STROKE] - w->position)};
    const double growth = turns ? 0.0 : w->velocity;
    valve(m, w, p, c, by, drift);
    double leak = v[LEAKAGE] * (p[A] - p[B]);
    for (int i = A; i <= B; i++) {
        double sign = i == A ? 1.0 : -1.0, flow = i == A ? c->flow_a : c->flow_b, net = flow - sign * leak;
        double fed_by = by[i][i];
        net += ports(v, p[i], &by[i][i]) - area[i] * w->velocity;
        net += held_burst(m, i, i == A ? v[BURST_A] : v[BURST_B], p, flow, fed_by, by[i], &drift[i]);
        by[i][i] -= v[LEAKAGE], by[i][1 - i] += v[LEAKAGE];
        Curve bulk = bulk_law(p[i], v[BULK_MODULUS], v[BULK_MODULUS_SLOPE], v[AIR_FRACTION]);
        double gain = bulk.y / volume[i];
        c->rate[i] = gain * net;
        for (int j = 0; j < 2; j++) c->jacobian[i][j] = gain * by[i][j];
        c->jacobian[i][i] += bulk.slope / volume[i] * net;
        c->drift[i] = gain * (drift[i] - area[i] * w->acceleration - net * area[i] * growth / volume[i]);
        Curve left = boiling_law(p[i], net);
        if (left.y < 1.0) {
            for (int j = 0; j < 2; j++) c->jacobian[i][j] *= left.y;
            c->jacobian[i][i] += left.slope * c->rate[i];
            c->rate[i] *= left.y, c->drift[i] *= left.y;
        }
    }
}

#endif
