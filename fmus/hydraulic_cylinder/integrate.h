/* One step of the stiff integrator RODAS3 (README, "Integration"): four stages, order 3(2), L-stable, exact Jacobian. */
#ifndef SKILLFRAME_INTEGRATE_H
#define SKILLFRAME_INTEGRATE_H

#include "chambers.h"

/* L and U of (1/(h/2) - J) in place, no pivoting: the matrix is diagonally dominant for every step worth taking. */
static inline void factor(double w[3][3], int n)
{
    for (int k = 0; k < n; k++)
        for (int i = k + 1; i < n; i++) {
            w[i][k] /= w[k][k];
            for (int j = k + 1; j < n; j++) w[i][j] -= w[i][k] * w[k][j];
        }
}

static inline void solve(double w[3][3], int n, double x[3])
{
    for (int i = 1; i < n; i++)
        for (int j = 0; j < i; j++) x[i] -= w[i][j] * x[j];
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) x[i] -= w[i][j] * x[j];
        x[i] /= w[i][i];
    }
}

/* Pressures after h from p; `begin` holds the chambers at the start. Returns the estimated error [Pa]. */
static inline double rosenbrock(const Model *m, const Chambers *begin, const Motion *end, double h, int n,
                                const double p[3], double after[3])
{
    double w[3][3], u1[3], u2[3], u3[3], u4[3], y[3] = {p[A], p[B], p[S]}, error = 0.0;
    Chambers c;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) w[i][j] = (i == j ? 2.0 / h : 0.0) - begin->jacobian[i][j];
    factor(w, n);
    for (int i = 0; i < n; i++) u1[i] = begin->rate[i] + 0.5 * h * begin->drift[i];
    solve(w, n, u1);
    for (int i = 0; i < n; i++) u2[i] = begin->rate[i] + 4.0 / h * u1[i] + 1.5 * h * begin->drift[i];
    solve(w, n, u2);
    for (int i = 0; i < n; i++) y[i] = p[i] + 2.0 * u1[i];
    chambers(m, end, y, &c);
    for (int i = 0; i < n; i++) u3[i] = c.rate[i] + (u1[i] - u2[i]) / h;
    solve(w, n, u3);
    for (int i = 0; i < n; i++) y[i] += u3[i];
    chambers(m, end, y, &c);
    for (int i = 0; i < n; i++) u4[i] = c.rate[i] + (u1[i] - u2[i] - 8.0 / 3.0 * u3[i]) / h;
    solve(w, n, u4);
    for (int i = 0; i < n; i++) {
        after[i] = y[i] + u4[i];
        if (i != S && after[i] < VAPOUR - BOILING) after[i] = VAPOUR - BOILING;   /* what the step's error may overshoot */
        error = fmax(error, fabs(u4[i]));
    }
    for (int i = n; i < 3; i++) after[i] = p[i];
    return isfinite(error) && isfinite(after[A] + after[B] + after[S]) ? error : HUGE_VAL;
}

#endif
