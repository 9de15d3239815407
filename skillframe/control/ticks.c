/* What motors, limits, inner loop and admittance law do to each number of N arms, without numpy.
 *
 * Everything is prepared in Python (ticks.py), where products of matrices and sums of squares stay. Each line rounds as
 * the numpy that it stands for, and what is not a number stays so. */
#include <math.h>
#include <stdint.h>

#define OUT __attribute__((visibility("default")))

/* As numpy's maximum and minimum: not a number if either is none. */
static double larger(double a, double b) { return isnan(a) || a > b ? a : b; }
static double smaller(double a, double b) { return isnan(a) || a < b ? a : b; }

typedef struct {
    double *now, *peak;
    const double *last, *middle, *most;
    int64_t count, nv;
} Held;

/* Change of torque, torque, speed and place of N motors: the first is found, the last is taken from the middle, and
 * both are held against the most so far. Returns how many are above what a motor can give. */
OUT int64_t held(const Held *h)
{
    int64_t over = 0, nv = h->nv;
    for (int64_t i = 0; i < h->count; i++) {
        double *now = h->now + 4 * nv * i, *peak = h->peak + 4 * nv * i;
        const double *most = h->most + 4 * nv * i;
        for (int64_t d = 0; d < nv; d++) {
            now[d] = now[nv + d] - h->last[nv * i + d];
            now[3 * nv + d] -= h->middle[nv * i + d];
        }
        for (int64_t d = 0; d < 4 * nv; d++) {
            double size = fabs(now[d]);
            peak[d] = larger(peak[d], size);
            over += size > most[d];
        }
    }
    return over;
}

typedef struct {
    const double *values, *energy, *centre, *bounds;
    double most_energy;
    int64_t count;
} Guard;

/* Are position, twist, wrench and command (21 numbers each) of all trials surely inside their limits? */
OUT int64_t fine(const Guard *g)
{
    static const int64_t first[4] = {3, 9, 12, 15}, past[4] = {6, 12, 15, 21}; /* speed, force, torque, command */
    for (int64_t i = 0; i < g->count; i++) {
        double d[21];
        for (int64_t k = 0; k < 21; k++) {
            d[k] = g->values[21 * i + k] - g->centre[k];
            d[k] *= d[k];
        }
        for (int64_t k = 0; k < 3; k++)
            if (!(d[k] <= g->bounds[k])) return 0;
        for (int64_t k = 0; k < 4; k++) {
            double sum = 0.0;
            for (int64_t j = first[k]; j < past[k]; j++) sum += d[j];
            if (!(sum <= g->bounds[3 + k])) return 0;
        }
        if (!(g->energy[i] <= g->most_energy)) return 0;
    }
    return 1;
}

typedef struct {
    const double *line, *position, *velocity;
    double *place, *speed, *asked;
    double back, fade, late, stiff, a, b, u, c, d, v;
    int64_t of_position, numbers;
} Inner;

/* Accelerations that an inner loop asks for at what it hears now, and its filter a tick on. */
OUT int64_t inner(const Inner *n, int64_t heard_at)
{
    const double *heard = n->line + heard_at * n->numbers;
    for (int64_t k = 0; k < n->numbers; k++) {
        double place = n->place[k], speed = n->speed[k], off = place - heard[k];
        double rate = n->back * (n->of_position ? off : heard[k]) + n->fade * speed;
        n->asked[k] = rate - n->late * n->velocity[k] + n->stiff * (place - n->position[k]);
        if (n->of_position) {
            n->place[k] = heard[k] + n->a * off + n->b * speed;
            n->speed[k] = n->c * off + n->d * speed;
        } else {
            n->place[k] = place + n->b * speed + n->u * heard[k];
            n->speed[k] = n->d * speed + n->v * heard[k];
        }
    }
    return 0;
}

typedef struct {
    const double *turn, *desired, *at, *angle, *sine;
    double *cosine, *axis, *error;
    int64_t count;
} Apart;

/* Sine times axis (N, 3) and cosine of the turn between two attitudes. */
OUT int64_t turned(const Apart *p)
{
    for (int64_t i = 0; i < p->count; i++) {
        const double *r = p->turn + 9 * i;
        double *w = p->axis + 3 * i;
        w[0] = 0.5 * (r[7] - r[5]);
        w[1] = 0.5 * (r[2] - r[6]);
        w[2] = 0.5 * (r[3] - r[1]);
        p->cosine[i] = 0.5 * (r[0] + r[4] + r[8] - 1.0);
    }
    return 0;
}

/* The error of a pose. Returns whether a turn is near pi, where this is not how to find its axis. */
OUT int64_t apart(const Apart *p)
{
    int64_t near_pi = 0;
    for (int64_t i = 0; i < p->count; i++) {
        double sine = p->sine[i], factor = sine > 1e-9 ? p->angle[i] / larger(sine, 1e-9) : 1.0;
        near_pi |= sine < 1e-4 && p->cosine[i] < 0.0;
        for (int64_t d = 0; d < 3; d++) {
            p->error[6 * i + d] = p->desired[3 * i + d] - p->at[3 * i + d];
            p->error[6 * i + 3 + d] = p->axis[3 * i + d] * factor;
        }
    }
    return near_pi;
}

typedef struct {
    const double *wanted, *twist, *forward, *spring, *braked;
    double *off, *law;
    int64_t numbers;
} Spring;

/* Desired less measured twist. */
OUT int64_t off(const Spring *s, double ramp)
{
    for (int64_t k = 0; k < s->numbers; k++) s->off[k] = ramp * s->wanted[k] - s->twist[k];
    return 0;
}

/* Spring, damper and feed-forward together. */
OUT int64_t sprung(const Spring *s, double ramp)
{
    for (int64_t k = 0; k < s->numbers; k++) s->law[k] = s->spring[k] + s->braked[k] + ramp * s->forward[k];
    return 0;
}

typedef struct {
    const double *twist, *wanted, *forward, *spring, *braked, *wrench, *squares, *felt, *push, *quiet;
    double *error, *drive, *force;
    double step;
    int64_t count;
} Law;

/* The error of a pose, a step on. */
OUT int64_t ahead(const Law *l)
{
    for (int64_t k = 0; k < 6 * l->count; k++) l->error[k] -= l->step * l->twist[k];
    return 0;
}

/* Spring and ramp times what is wanted besides. */
OUT int64_t driven(const Law *l, double ramp)
{
    for (int64_t k = 0; k < 6 * l->count; k++) l->drive[k] = l->spring[k] + ramp * (l->wanted[k] + l->forward[k]);
    return 0;
}

/* The drive held to the push, and with damping and what is felt: force and torque each by the sums of their squares. */
OUT int64_t pushed(const Law *l)
{
    for (int64_t i = 0; i < l->count; i++) {
        double touching = l->felt[2 * i] > l->quiet[0] || l->felt[2 * i + 1] > l->quiet[1] ? 1.0 : 0.0;
        for (int64_t half = 0; half < 2; half++) {
            double share = larger(sqrt(l->squares[2 * i + half]) / l->push[half], 1.0);
            for (int64_t k = 6 * i + 3 * half; k < 6 * i + 3 * half + 3; k++) {
                l->drive[k] /= share;
                l->force[k] = l->drive[k] - l->braked[k] + l->wrench[k] * touching;
            }
        }
    }
    return 0;
}

typedef struct {
    double *slow, *up, *down, *least;
    const double *force;
    double follow, fade;
    int64_t numbers;
} Ring;

/* What a force does beside its slow part, up and down, and the lesser of both. */
OUT int64_t rung(const Ring *r)
{
    for (int64_t k = 0; k < r->numbers; k++) {
        double off = r->force[k] - r->slow[k];
        r->slow[k] = r->slow[k] + r->follow * off;
        r->up[k] = larger(off, r->fade * r->up[k]);
        r->down[k] = larger(-off, r->fade * r->down[k]);
        r->least[k] = smaller(r->up[k], r->down[k]);
    }
    return 0;
}

typedef struct {
    const double *home, *command, *measured, *twist, *made, *answer, *velocity, *lower, *upper, *leash;
    double *spare, *left, *speed;
    double posture, step;
    int64_t count, joints;
} Steps;

/* What spare joints do: back to their posture. */
OUT int64_t spare(const Steps *s)
{
    for (int64_t k = 0; k < s->count * s->joints; k++)
        s->spare[k] = s->joints > 6 ? s->posture * (s->home[k] - s->command[k]) : 0.0;
    return 0;
}

/* The twist that is left for the others. */
OUT int64_t left(const Steps *s)
{
    for (int64_t k = 0; k < 6 * s->count; k++) s->left[k] = s->twist[k] - s->made[k];
    return 0;
}

/* Joint velocities. Returns whether a joint may be too fast, over its range or too far ahead. */
OUT int64_t speeds(const Steps *s)
{
    int64_t doubt = 0;
    for (int64_t i = 0; i < s->count; i++)
        for (int64_t j = 0; j < s->joints; j++) {
            int64_t k = i * s->joints + j;
            double command = s->command[k], speed = s->speed[k] = s->spare[k] + s->answer[k];
            double ahead = command + s->step * speed;
            doubt |= !(fabs(speed) / s->velocity[j] <= 1.0) || ahead > s->upper[j] || ahead < s->lower[j]
                || fabs(command - s->measured[k]) > s->leash[j];
        }
    return doubt;
}

typedef struct {
    const double *measured, *lever, *gain, *slope_gain;
    double *value, *slope, *moved;
    double step;
    int64_t count;
} Filter;

/* Equation (1) of skillframe.signals.kalman for wrenches, and these taken at points that lie `lever` away. */
OUT int64_t filtered(const Filter *f)
{
    for (int64_t i = 0; i < f->count; i++) {
        double *value = f->value + 6 * i, *slope = f->slope + 6 * i, *moved = f->moved + 6 * i;
        const double *lever = f->lever + 3 * i;
        for (int64_t d = 0; d < 6; d++) {
            double ahead = value[d] + f->step * slope[d], error = f->measured[6 * i + d] - ahead;
            value[d] = ahead + f->gain[d] * error;
            slope[d] = slope[d] + f->slope_gain[d] * error;
        }
        for (int64_t d = 0; d < 3; d++) {
            int64_t next = (d + 1) % 3, after = (d + 2) % 3;
            moved[d] = value[d];
            moved[3 + d] = value[3 + d] - (lever[next] * value[after] - lever[after] * value[next]);
        }
    }
    return 0;
}
