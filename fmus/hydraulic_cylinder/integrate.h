/* One step of the stiff integrator RODAS3 (README, "Integration"): four stages, order 3(2), L-stable, exact Jacobian. */
#ifndef SKILLFRAME_INTEGRATE_H
#define SKILLFRAME_INTEGRATE_H

#include "chambers.h"

/* L and U of (1/(h/2) - J) in place, no pivoting: the matrix is diagonally dominant for every step worth taking. */
static inline void factor(double w[2][2])
{
    w[B][A] /= w[A][A];
    w[B][B] -= w[B][A] * w[A][B];
}

static inline void solve(double w[2][2], double x[2])
{
    x[B] -= w[B][A] * x[A];
    x[B] /= w[B][B];
    x[A] -= w[A][B] * x[B];
    x[A] /= w[A][A];
}

/* Pressures after h from p; `begin` holds the chambers at the start. Returns the estimated error [Pa]. */
static inline double rosenbrock(const Model *m, const Chambers *begin, const Motion *end, double h,
                                const double p[2], double after[2])
{
    double w[2][2], u1[2], u2[2], u3[2], u4[2], y[2] = {p[A], p[B]}, error = 0.0;
    Chambers c;
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) w[i][j] = (i == j ? 2.0 / h : 0.0) - begin->jacobian[i][j];
    factor(w);
    for (int i = 0; i < 2; i++) u1[i] = begin->rate[i] + 0.5 * h * begin->drift[i];
    solve(w, u1);
    for (int i = 0; i < 2; i++) u2[i] = begin->rate[i] + 4.0 / h * u1[i] + 1.5 * h * begin->drift[i];
    solve(w, u2);
    for (int i = 0; i < 2; i++) y[i] = p[i] + 2.0 * u1[i];
    chambers(m, end, y, &c);
    for (int i = 0; i < 2; i++) u3[i] = c.rate[i] + (u1[i] - u2[i]) / h;
    solve(w, u3);
    for (int i = 0; i < 2; i++) y[i] += u3[i];
    chambers(m, end, y, &c);
    for (int i = 0; i < 2; i++) u4[i] = c.rate[i] + (u1[i] - u2[i] - 8.0 / 3.0 * u3[i]) / h;
    solve(w, u4);
    for (int i = 0; i < 2; i++) {
        after[i] = y[i] + u4[i];
        if (after[i] < VAPOUR - BOILING) after[i] = VAPOUR - BOILING;   /* what the step's error may overshoot */
        error = fmax(error, fabs(u4[i]));
    }
    return isfinite(error) && isfinite(after[A] + after[B]) ? error : HUGE_VAL;
}

#endif
