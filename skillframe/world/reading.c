/* Jacobian and wrist sensor of N arms, number by number: `Layout.jacobian` and `Sensors.sample` without numpy.
 *
 * Everything is prepared in Python (reading.py). Each line rounds as the numpy that it stands for. */
#include <stdint.h>

#define OUT __attribute__((visibility("default")))

typedef struct {
    const double *anchor, *axis, *matrix, *position, *turned;
    double *jacobian;
    const int64_t *hinges, *hinge_dofs, *slides, *slide_dofs;
    int64_t anchor_step, axis_step, matrix_step, position_step, trials, n_hinges, n_slides, nv, base;
} Arm;

typedef struct {
    const double *sensor, *noise, *bias, *weight, *lever;
    double *raw, *wrench;
    int64_t sensor_step, trials;
} Wrist;

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Columns 3 to 5 of a free base, [axis x (p - anchor); axis] of each of its body's axes. Those before them stay. */
static void turning(const double *matrix, const double *anchor, const double *point, double *out, int64_t nv)
{
    const double lever[3] = {point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]};
    for (int64_t k = 0; k < 3; k++) {
        const double axis[3] = {matrix[k], matrix[3 + k], matrix[6 + k]};
        double way[3];
        cross(axis, lever, way);
        for (int64_t d = 0; d < 3; d++) {
            out[d * nv + 3 + k] = way[d];
            out[(3 + d) * nv + 3 + k] = axis[d];
        }
    }
}

/* Columns [a x (p - anchor); a] of hinges, [a; 0] of slides, for the point p that lies `turned` from the tool frame.
 * `base` is the body of a free base, or -1. */
OUT int64_t jacobian(const Arm *arm)
{
    int64_t nv = arm->nv;
    for (int64_t i = 0; i < arm->trials; i++) {
        const double *at = arm->position + i * arm->position_step, *turned = arm->turned + 3 * i;
        const double point[3] = {at[0] + turned[0], at[1] + turned[1], at[2] + turned[2]};
        double *out = arm->jacobian + i * 6 * nv;
        for (int64_t k = 0; k < arm->n_hinges; k++) {
            const double *a = arm->axis + i * arm->axis_step + 3 * arm->hinges[k];
            const double *c = arm->anchor + i * arm->anchor_step + 3 * arm->hinges[k];
            const double lever[3] = {point[0] - c[0], point[1] - c[1], point[2] - c[2]};
            double way[3];
            cross(a, lever, way);
            for (int64_t d = 0; d < 3; d++) {
                out[d * nv + arm->hinge_dofs[k]] = way[d];
                out[(3 + d) * nv + arm->hinge_dofs[k]] = a[d];
            }
        }
        for (int64_t k = 0; k < arm->n_slides; k++) {
            const double *a = arm->axis + i * arm->axis_step + 3 * arm->slides[k];
            for (int64_t d = 0; d < 3; d++) out[d * nv + arm->slide_dofs[k]] = a[d];
        }
        if (arm->base >= 0)
            turning(arm->matrix + i * arm->matrix_step + 9 * arm->base, arm->anchor + i * arm->anchor_step, point, out, nv);
    }
    return 0;
}

/* What the wrist reads, with its bias and the noise of a sample: 12 numbers a trial, force and torque first. */
OUT int64_t felt(const Wrist *wrist, int64_t sample)
{
    for (int64_t i = 0; i < wrist->trials; i++) {
        const double *sensor = wrist->sensor + i * wrist->sensor_step, *bias = wrist->bias + 6 * i;
        const double *noise = wrist->noise + 12 * (sample * wrist->trials + i);
        for (int64_t d = 0; d < 6; d++) wrist->raw[6 * i + d] = -sensor[d] + (bias[d] + noise[d]);
    }
    return 0;
}

/* The tool's weight out of wrenches in base axes, at the levers of its centre of mass. */
OUT int64_t weightless(const Wrist *wrist)
{
    for (int64_t i = 0; i < wrist->trials; i++) {
        double *wrench = wrist->wrench + 6 * i, turning[3];
        cross(wrist->lever + 3 * i, wrist->weight, turning);
        for (int64_t d = 0; d < 3; d++) {
            wrench[d] -= wrist->weight[d];
            wrench[3 + d] -= turning[d];
        }
    }
    return 0;
}

typedef struct {
    const double *rotation;
    double *row;
    int64_t count;
} Turns;

/* Of each rotation the best conditioned row of 4 q q^T. Returns how many rotations are not finite and have none. */
OUT int64_t quaternions(const Turns *turns)
{
    int64_t unknown = 0;
    for (int64_t i = 0; i < turns->count; i++) {
        const double *r = turns->rotation + 9 * i;
        double *q = turns->row + 4 * i, xx = r[0], yy = r[4], zz = r[8], trace = xx + yy + zz;
        unknown += trace - trace != 0.0;
        if (xx >= yy && xx >= zz && xx >= trace) {
            q[0] = 1.0 + 2.0 * xx - trace, q[1] = r[1] + r[3], q[2] = r[2] + r[6], q[3] = r[7] - r[5];
        } else if (yy >= zz && yy >= trace) {
            q[0] = r[3] + r[1], q[1] = 1.0 + 2.0 * yy - trace, q[2] = r[5] + r[7], q[3] = r[2] - r[6];
        } else if (zz >= trace) {
            q[0] = r[6] + r[2], q[1] = r[7] + r[5], q[2] = 1.0 + 2.0 * zz - trace, q[3] = r[3] - r[1];
        } else {
            q[0] = r[7] - r[5], q[1] = r[2] - r[6], q[2] = r[3] - r[1], q[3] = 1.0 + trace;
        }
    }
    return unknown;
}
