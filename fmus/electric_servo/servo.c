/* The servo as a model of fmus/common: start, step, outputs, rates and events. Equations: README.md. */
#include <math.h>
#include <stdio.h>

#include "model.h"

#define REPORT(...) (snprintf(r->text, sizeof r->text, __VA_ARGS__))
#define MOST_SUBSTEPS 100000

/* States of an instant; of rates, the rate of each, with the spring's torque and power as those of impulse and work. */
typedef struct { double angle, speed, current, deflection, impulse, work; } State;
typedef struct { double position, velocity; } Joint;

static double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static Joint joint_at(const Model *m, double t)
{
    const double *v = m->value;
    Joint q = {v[POSITION] + t * (v[VELOCITY] + 0.5 * v[ACCELERATION] * t), v[VELOCITY] + v[ACCELERATION] * t};
    return q;
}

static double spring(const Model *m, const State *s, const Joint *q)
{
    return m->value[STIFFNESS] * (s->angle - q->position) + m->value[DAMPING] * (s->speed - q->velocity);
}

static double friction(const Model *m, const State *s)
{
    return m->value[COULOMB_FRICTION] / m->value[PRESLIDING] * s->deflection + m->value[VISCOUS_FRICTION] * s->speed;
}

/* Current that the inner loop, or the torque alone, asks for (README eq. 1 and 2). */
static double wanted_current(const Model *m, const State *s)
{
    const double *v = m->value;
    double torque = v[TORQUE], limit = v[CURRENT_LIMIT];
    if (v[POSITION_GAIN] > 0.0) torque += v[POSITION_GAIN] * (v[TARGET] - s->angle) - v[VELOCITY_GAIN] * s->speed;
    double current = torque / m->own.per_ampere;
    return limit > 0.0 ? clip(current, -limit, limit) : current;
}

static State rates_of(const Model *m, const State *s, const Joint *q)
{
    double force = spring(m, s, q), motor = m->own.per_ampere * s->current;
    State d = {s->speed, (motor - friction(m, s) - force) / m->own.inertia,
               (wanted_current(m, s) - s->current) / m->value[CURRENT_TIME],
               s->speed - fabs(s->speed) * s->deflection / m->value[PRESLIDING], force, force * q->velocity};
    return d;
}

static State moved(const State *s, const State *d, double h)
{
    State n = {s->angle + h * d->angle, s->speed + h * d->speed, s->current + h * d->current,
               s->deflection + h * d->deflection, s->impulse + h * d->impulse, s->work + h * d->work};
    return n;
}

static State present(const Model *m)
{
    const double *v = m->value;
    State s = {v[MOTOR_POSITION], v[MOTOR_VELOCITY], v[CURRENT], v[DEFLECTION], 0.0, 0.0};
    return s;
}

/* The classical Runge-Kutta step of order 4. */
static State runge_kutta(const Model *m, const State *s, double t, double h)
{
    Joint at = joint_at(m, t), mid = joint_at(m, t + 0.5 * h), end = joint_at(m, t + h);
    State a = rates_of(m, s, &at), n = moved(s, &a, 0.5 * h);
    State b = rates_of(m, &n, &mid);
    n = moved(s, &b, 0.5 * h);
    State c = rates_of(m, &n, &mid);
    n = moved(s, &c, h);
    State d = rates_of(m, &n, &end);
    n = moved(s, &a, h / 6.0), n = moved(&n, &b, h / 3.0), n = moved(&n, &c, h / 3.0);
    return moved(&n, &d, h / 6.0);
}

/* A step that Runge-Kutta takes with ease: of the current, the spring, the dampers and the presliding deflection. */
static double easy_step(const Model *m, const State *s)
{
    const double *v = m->value;
    double stiff = v[STIFFNESS] + v[POSITION_GAIN] + v[COULOMB_FRICTION] / v[PRESLIDING];
    double damped = v[DAMPING] + v[VISCOUS_FRICTION] + v[VELOCITY_GAIN], h = fmin(v[SUBSTEP], 0.5 * v[CURRENT_TIME]);
    h = fmin(h, 0.3 / sqrt(stiff / m->own.inertia));
    if (damped > 0.0) h = fmin(h, 0.5 * m->own.inertia / damped);
    return fmin(h, v[PRESLIDING] / fmax(fabs(s->speed), 1e-30));
}

static void write_state(Model *m, const State *s)
{
    double *v = m->value;
    v[MOTOR_POSITION] = s->angle, v[MOTOR_VELOCITY] = s->speed, v[CURRENT] = s->current, v[DEFLECTION] = s->deflection;
}

static Outcome require(int fine, const char *name, const char *rule, double value, Report *r)
{
    if (fine) return OK;
    REPORT("parameter %s is %g; it must be %s", name, value, rule);
    return FAILED;
}

static Outcome check_parameters(const Model *m, Report *r)
{
    static const int positive[] = {GEAR, ROTOR_INERTIA, TORQUE_CONSTANT, CURRENT_TIME, PRESLIDING, STIFFNESS};
    static const int not_negative[] = {CURRENT_LIMIT, VISCOUS_FRICTION, COULOMB_FRICTION, DAMPING, POSITION_GAIN,
                                       VELOCITY_GAIN};
    const double *v = m->value;
    Outcome out = OK;
    for (size_t i = 0; i < sizeof positive / sizeof *positive && out == OK; i++)
        out = require(v[positive[i]] > 0.0, VARIABLES[positive[i]].name, "greater than zero", v[positive[i]], r);
    for (size_t i = 0; i < sizeof not_negative / sizeof *not_negative && out == OK; i++)
        out = require(v[not_negative[i]] >= 0.0, VARIABLES[not_negative[i]].name, "zero or more", v[not_negative[i]], r);
    return out == OK ? require(v[SUBSTEP] >= 1e-6, "substep", "at least 1e-6 s", v[SUBSTEP], r) : out;
}

/* ---- what the faces call ---- */

/* Static equilibrium: the spring holds initial_force, the current too, the friction is relaxed (README eq. 6). */
Outcome model_start(Model *m, Report *r)
{
    double *v = m->value;
    Outcome out = check_parameters(m, r);
    if (out != OK) return out;
    m->own.inertia = v[GEAR] * v[GEAR] * v[ROTOR_INERTIA];
    m->own.per_ampere = v[GEAR] * v[TORQUE_CONSTANT];
    m->own.position = v[POSITION], m->own.velocity = v[VELOCITY];
    v[MOTOR_POSITION] = v[POSITION] + v[INITIAL_FORCE] / v[STIFFNESS];
    v[MOTOR_VELOCITY] = v[VELOCITY], v[DEFLECTION] = v[WORK] = 0.0;
    v[CURRENT] = v[INITIAL_FORCE] / m->own.per_ampere;
    m->own.stale = 1.0;
    model_outputs(m, r);
    v[FORCE_MEAN] = v[FORCE];
    if (!(v[CURRENT_LIMIT] > 0.0) || fabs(v[CURRENT]) <= v[CURRENT_LIMIT]) return OK;
    REPORT("initial_force %g N m needs %.4g A, above current_limit of %g A; the joint will give way", v[INITIAL_FORCE],
           v[CURRENT], v[CURRENT_LIMIT]);
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
    State s = present(m);
    Joint q = {m->own.position, m->own.velocity};
    m->value[FORCE] = spring(m, &s, &q);
    m->value[FRICTION] = friction(m, &s);
    m->value[MOTOR_TORQUE] = m->own.per_ampere * s.current;
    m->own.stale = 0.0;
    return OK;
}

Outcome model_step(Model *m, double step, Report *r)
{
    State s = present(m);
    double t = 0.0;
    for (int n = 0; t < step; n++) {
        double h = easy_step(m, &s);
        if (t + 1.0001 * h >= step) h = step - t;
        s = runge_kutta(m, &s, t, h);
        t = t + h >= step - 1e-15 ? step : t + h;
        if (n < MOST_SUBSTEPS && isfinite(s.angle + s.speed + s.current + s.deflection)) continue;
        REPORT("no finite motor motion within %g s at %.6g s (speed %.3g rad/s); check joint motion and parameters", step,
               m->time + t, s.speed);
        return DISCARD;
    }
    Joint q = joint_at(m, step);
    write_state(m, &s);
    m->value[FORCE_MEAN] = s.impulse / step, m->value[WORK] = s.work;
    m->own.position = q.position, m->own.velocity = q.velocity, m->own.stale = 1.0;
    return model_outputs(m, r);
}

Outcome model_rates(Model *m, double rates[], Report *r)
{
    double *v = m->value;
    State s = present(m);
    Joint q = {m->own.position, m->own.velocity};
    State d = rates_of(m, &s, &q);
    v[DER_MOTOR_POSITION] = d.angle, v[DER_MOTOR_VELOCITY] = d.speed;
    v[DER_CURRENT] = d.current, v[DER_DEFLECTION] = d.deflection;
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
    (void)m, (void)next, (void)r;
    return OK;
}
