/* The hydraulic cylinder as a model of fmus/common: start, step, outputs, rates and events. Equations: README.md. */
#include "chambers.h"
#include "checks.h"
#include "integrate.h"

#define PI 3.14159265358979323846
#define LEAST_SUBSTEP 1e-9   /* s */

/* ---- command ---- */

static double demand_at(const Model *m, double time)
{
    const Own *o = &m->own;
    double slew = m->value[SPOOL_SLEW], way = o->target - o->demand, done = slew * (time - o->demand_time);
    if (slew <= 0.0 || done >= fabs(way)) return o->target;
    return o->demand + (way < 0.0 ? -done : done);
}

/* Saturation, then play: the spool's target follows the command only once the play is used up (README eq. 1). */
static void take_command(Model *m)
{
    double u = clip(m->value[COMMAND], -1.0, 1.0), half = 0.5 * m->value[HYSTERESIS];
    double target = clip(m->own.target, u - half, u + half);
    m->own.demand = demand_at(m, m->time);
    m->own.demand_time = m->time;
    m->own.target = target;
}

static double ramp_end(const Model *m)
{
    double slew = m->value[SPOOL_SLEW], way = fabs(m->own.target - m->own.demand);
    return slew > 0.0 && way > 0.0 ? m->own.demand_time + way / slew : -HUGE_VAL;
}

/* The spool at `t` after a step's start, where it was `s`. */
static Spool spool_at(const Model *m, Spool s, double t)
{
    const Own *o = &m->own;
    double slew = m->value[SPOOL_SLEW], way = o->target - o->demand, damping = m->value[SPOOL_DAMPING];
    double ramp = way < 0.0 ? -slew : slew, arrival = slew > 0.0 ? fabs(way) / slew : 0.0;
    if (t <= arrival) return spool_after(s, o->demand, way == 0.0 ? 0.0 : ramp, t, o->omega, damping);
    if (arrival > 0.0) s = spool_after(s, o->demand, ramp, arrival, o->omega, damping);
    return spool_after(s, o->target, 0.0, t - arrival, o->omega, damping);
}

/* ---- force ---- */

static double end_stop(const Model *m, double x, double v)
{
    if (is_motor(m)) return 0.0;
    double low = -x, high = x - m->value[STROKE], k = m->value[ENDSTOP_STIFFNESS], d = m->value[ENDSTOP_DAMPING];
    if (low > 0.0) return fmax(0.0, k * low - d * v);
    if (high > 0.0) return -fmax(0.0, k * high + d * v);
    return 0.0;
}

static double limit_at(const Model *m, double v)
{
    const double *p = m->value;
    return sliding_deflection(v, p[PRESLIDING_LENGTH], p[COULOMB_FRICTION], p[STATIC_FRICTION], p[STRIBECK_VELOCITY]);
}

static double deflection_rate(const Model *m, double z, double v) { return v - fabs(v) * z / limit_at(m, v); }

static double friction(const Model *m, double z, double v) { return m->own.stiffness * z + m->value[VISCOUS_FRICTION] * v; }

/* Force without the seals' deflection, and its rate, at one instant: what the quadrature of impulse and work needs. */
typedef struct { double smooth, rate, stop; } Push;

static Push push(const Model *m, const double p[2], const Chambers *c, const Motion *w)
{
    const Own *o = &m->own;
    double viscous = m->value[VISCOUS_FRICTION];
    Push f = {o->area_a * p[A] - o->area_b * p[B] - viscous * w->velocity,
              o->area_a * c->rate[A] - o->area_b * c->rate[B] - viscous * w->acceleration,
              end_stop(m, w->position, w->velocity)};
    return f;
}

/* Impulse and work over one internal step: corrected trapezoidal rule (order 4), plain for the end stops. */
static void accumulate(const Push *f, const Motion *a, const Push *g, const Motion *b, double h, double *impulse,
                       double *work)
{
    double fv = f->rate * a->velocity + f->smooth * a->acceleration;
    double gv = g->rate * b->velocity + g->smooth * b->acceleration;
    *impulse += 0.5 * h * (f->smooth + f->stop + g->smooth + g->stop) + h * h / 12.0 * (f->rate - g->rate);
    *work += 0.5 * h * ((f->smooth + f->stop) * a->velocity + (g->smooth + g->stop) * b->velocity)
             + h * h / 12.0 * (fv - gv);
}

static void write_outputs(Model *m, const Chambers *c)
{
    double *v = m->value, z = v[DEFLECTION], speed = m->own.velocity;
    v[FRICTION] = friction(m, z, speed);
    v[FORCE] = m->own.area_a * v[PRESSURE_A] - m->own.area_b * v[PRESSURE_B] - v[FRICTION]
               + end_stop(m, m->own.position, speed);
    v[FLOW_A] = c->flow_a, v[FLOW_B] = c->flow_b, v[FLOW_SUPPLY] = c->flow_supply;
    v[SUPPLY_SLOPE] = c->supply_slope;
    m->own.stale = 0.0;
}

static Motion present(const Model *m)
{
    const double *v = m->value;
    Motion w = {m->own.position, m->own.velocity, v[ACCELERATION], {v[SPOOL], v[SPOOL_VELOCITY]}};
    return w;
}

/* ---- what the faces call ---- */

static void derive(Model *m)
{
    const double *v = m->value;
    double drop = v[RATED_PRESSURE_DROP] * (v[RATED_DROP_IS_PER_EDGE] != 0.0 ? 1.0 : 0.5);
    m->own.area_a = 0.25 * PI * v[BORE] * v[BORE];
    m->own.area_b = m->own.area_a - 0.25 * PI * v[ROD] * v[ROD];
    if (is_motor(m)) m->own.area_a = m->own.area_b = v[DISPLACEMENT];
    m->own.edge = v[RATED_FLOW] / sqrt(drop);
    m->own.cushion = v[CUSHION_FLOW] / sqrt(v[RATED_PRESSURE_DROP]);
    m->own.counterbalance = v[COUNTERBALANCE_FLOW] / sqrt(v[COUNTERBALANCE_DROP]);
    m->own.omega = 2.0 * PI * v[SPOOL_FREQUENCY];
    m->own.stiffness = v[COULOMB_FRICTION] / v[PRESLIDING_LENGTH];
}

/* Static equilibrium: closed or steadily open valve, pressures that hold initial_force (README eq. 10). */
static void settle(Model *m)
{
    double *v = m->value, low = v[INITIAL_PRESSURE], u = clip(v[COMMAND], -1.0, 1.0);
    double over = v[INITIAL_FORCE] - (m->own.area_a - m->own.area_b) * low;
    v[PRESSURE_A] = over > 0.0 ? low + over / m->own.area_a : low;
    v[PRESSURE_B] = over > 0.0 ? low : low - over / m->own.area_b;
    v[SPOOL] = m->own.target = m->own.demand = u;
    m->own.demand_time = m->time;
    v[SPOOL_VELOCITY] = v[DEFLECTION] = v[WORK] = 0.0;
    m->own.position = v[POSITION], m->own.velocity = v[VELOCITY];
}

Outcome model_start(Model *m, Report *r)
{
    Outcome out = check_parameters(m, r);
    if (out != OK) return out;
    derive(m);
    out = check_position(m, m->value[POSITION], r);
    if (out != OK) return FAILED;
    settle(m);
    m->own.stale = 1.0;
    model_outputs(m, r);
    m->value[FORCE_MEAN] = m->value[FORCE];
    double highest = fmax(m->value[PRESSURE_A], m->value[PRESSURE_B]);
    if (highest <= m->value[RELIEF_PRESSURE]) return OK;
    REPORT("initial_force %g N needs %.4g bar, above the port relief at %.4g bar; the piston will give way",
           m->value[INITIAL_FORCE], highest / 1e5, m->value[RELIEF_PRESSURE] / 1e5);
    return WARNING;
}

void model_touch(Model *m, unsigned variable)
{
    if (variable == POSITION) m->own.position = m->value[POSITION];
    if (variable == VELOCITY) m->own.velocity = m->value[VELOCITY];
    m->own.stale = 1.0;
}

Outcome model_outputs(Model *m, Report *r)
{
    (void)r;
    if (m->own.stale == 0.0) return OK;
    Chambers c;
    Motion w = present(m);
    const double p[2] = {m->value[PRESSURE_A], m->value[PRESSURE_B]};
    chambers(m, &w, p, &c);
    write_outputs(m, &c);
    return OK;
}

/* Motion at t after the step's start; piston motion is a parabola through the inputs. */
static Motion motion_at(const Model *m, Spool s, double t)
{
    const double *v = m->value;
    double a = v[ACCELERATION];
    Motion w = {v[POSITION] + t * (v[VELOCITY] + 0.5 * a * t), v[VELOCITY] + a * t, a, spool_at(m, s, t)};
    return w;
}

/* End of the next internal step: the usual length, or the piston's reversal, or the end of the slewed command. */
static double next_break(double t, double usual, double step, const double breaks[2])
{
    double end = t + usual * 1.0001 >= step ? step : t + usual;
    for (int i = 0; i < 2; i++)
        if (breaks[i] > t + LEAST_SUBSTEP && breaks[i] < end - LEAST_SUBSTEP) end = breaks[i];
    return end;
}

Outcome model_step(Model *m, double step, Report *r)
{
    double *v = m->value, a = v[ACCELERATION], t = 0.0, impulse = 0.0, work = 0.0, z = v[DEFLECTION];
    double p[2] = {v[PRESSURE_A], v[PRESSURE_B]}, q[2];
    Spool s0 = {v[SPOOL], v[SPOOL_VELOCITY]};
    double largest = step / ceil(step / v[SUBSTEP] * 0.9999), usual = largest;
    double last = v[POSITION] + step * (v[VELOCITY] + 0.5 * a * step);
    take_command(m);
    double breaks[2] = {a != 0.0 ? -v[VELOCITY] / a : -1.0, ramp_end(m) - m->time};
    Outcome out = check_position(m, v[POSITION], r);
    if (out == OK) out = check_position(m, last, r);
    if (out != OK) return out;
    Motion here = motion_at(m, s0, 0.0), there;
    Chambers c, d;
    chambers(m, &here, p, &c);
    Push f = push(m, p, &c, &here), g;
    while (t < step) {
        double end = next_break(t, usual, step, breaks), h = end - t;
        there = motion_at(m, s0, end);
        double error = rosenbrock(m, &c, &there, h, p, q);
        if (error > v[TOLERANCE]) {
            usual = h * clip(0.8 * cbrt(v[TOLERANCE] / error), 0.1, 0.7);
            if (usual >= LEAST_SUBSTEP) continue;
            REPORT("no finite pressures within %g s at %.6g s (error %.3g Pa); check velocity and parameters", h,
                   m->time + t, error);
            return DISCARD;
        }
        usual = fmin(largest, usual * clip(0.8 * cbrt(v[TOLERANCE] / fmax(error, 1e-30)), 1.0, 3.0));
        double mean = 0.5 * (here.velocity + there.velocity);
        Slide seals = slide(z, mean, h, limit_at(m, mean));
        z = seals.z, impulse -= m->own.stiffness * seals.integral, work -= m->own.stiffness * seals.work;
        chambers(m, &there, q, &d);
        g = push(m, q, &d, &there);
        accumulate(&f, &here, &g, &there, h, &impulse, &work);
        here = there, c = d, f = g, t = end;
        p[A] = q[A], p[B] = q[B];
    }
    v[PRESSURE_A] = p[A], v[PRESSURE_B] = p[B];
    v[SPOOL] = here.spool.x, v[SPOOL_VELOCITY] = here.spool.v, v[DEFLECTION] = z;
    v[FORCE_MEAN] = impulse / step, v[WORK] = work;
    m->own.position = here.position, m->own.velocity = here.velocity;
    write_outputs(m, &c);
    return OK;
}

Outcome model_rates(Model *m, double rates[], Report *r)
{
    double *v = m->value, demand = demand_at(m, m->time), w = m->own.omega;
    const double p[2] = {v[PRESSURE_A], v[PRESSURE_B]};
    Chambers c;
    Motion now = present(m);
    chambers(m, &now, p, &c);
    v[DER_PRESSURE_A] = c.rate[A], v[DER_PRESSURE_B] = c.rate[B];
    v[DER_SPOOL] = v[SPOOL_VELOCITY];
    v[DER_SPOOL_VELOCITY] = w * w * (demand - v[SPOOL]) - 2.0 * v[SPOOL_DAMPING] * w * v[SPOOL_VELOCITY];
    v[DER_DEFLECTION] = deflection_rate(m, v[DEFLECTION], now.velocity);
    for (unsigned i = 0; i < N_STATES; i++) {
        rates[i] = v[RATES[i]];
        if (isfinite(rates[i])) continue;
        REPORT("the rate of %s is not finite at %.6g s", VARIABLES[STATES[i]].name, m->time);
        return DISCARD;
    }
    return OK;
}

Outcome model_event(Model *m, double *next, Report *r)
{
    (void)r;
    take_command(m);
    double end = ramp_end(m);
    if (end > m->time) *next = end;
    return OK;
}
