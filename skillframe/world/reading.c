/* Jacobian and wrist sensor of N arms, number by number: `Layout.jacobian` and `Sensors.sample` without numpy.
 *
 * Everything is prepared in Python (reading.py). Each line rounds as the numpy that it stands for. */
#include <stdint.h>

#define OUT __attribute__((visibility("default")))

typedef struct {
    const double *anchor, *axis, *position, *turned;
    double *jacobian;
    const int64_t *hinges, *hinge_dofs, *slides, *slide_dofs;
    int64_t anchor_step, axis_step, position_step, trials, n_hinges, n_slides, nv;
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

/* Columns [a x (p - anchor); a] of hinges, [a; 0] of slides, for the point p that lies `turned` from the tool frame. */
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
