/* The numbers of a macro step, moved between a plant's arrays and a bank's: `Master._exchange` without numpy.
 *
 * Everything is prepared in Python (exchange.py). Bonds run trial by trial, as in the bank. Statuses are those of
 * stepper.c: from 2 on an actuator has failed, and the caller sees to it before `felt` or `end` is called again. */
#include <stddef.h>
#include <stdint.h>

typedef int (*Step)(void *slots, size_t n, const uint8_t *active, double time, double step);

typedef struct {
    const double *position, *velocity, *acceleration, *load;
    double *applied;
    const int64_t *places, *dofs, *still;
    double *u;
    const double *y;
    const uint8_t *active;
    double *force, *after, *ledger;
    void *slots, *go;
    int64_t position_step, velocity_step, acceleration_step, applied_step;
    int64_t trials, joints, freedoms, n_still, block;
    int64_t u_width, y_width, at_position, at_velocity, at_acceleration, force_column, work_column;
} Exchange;

enum { F0, F1, X0, X1, V0, V1, GIVEN, LENGTH };

static double *row_of(const Exchange *e, int what, int64_t row)
{
    return e->ledger + (what * e->block + row) * e->trials * e->joints;
}

static int go(const Exchange *e, double time, double step)
{
    return ((Step)e->go)(e->slots, (size_t)(e->trials * e->joints), e->active, time, step);
}

/* Generalised forces: the mean of both on the driven joints, and the load. */
static void drive(const Exchange *e, const double *one, const double *other)
{
    for (int64_t i = 0; i < e->trials; i++) {
        double *applied = e->applied + i * e->applied_step;
        const double *load = e->load + i * e->freedoms;
        for (int64_t d = 0; d < e->freedoms; d++) applied[d] = load[d];
        for (int64_t k = 0; k < e->joints; k++) {
            int64_t bond = i * e->joints + k;
            applied[e->dofs[k]] = 0.5 * (one[bond] + other[bond]) + load[e->dofs[k]];
        }
        for (int64_t s = 0; s < e->n_still; s++) applied[e->still[s]] = 0.0;
    }
}

/* Positions and velocities of the pistons, into rows of the ledger and the bank's inputs. */
static void show(const Exchange *e, double *x, double *v)
{
    for (int64_t i = 0; i < e->trials; i++)
        for (int64_t k = 0; k < e->joints; k++) {
            int64_t bond = i * e->joints + k;
            double *u = e->u + bond * e->u_width;
            u[e->at_position] = x[bond] = e->position[i * e->position_step + e->places[k]];
            u[e->at_velocity] = v[bond] = e->velocity[i * e->velocity_step + e->dofs[k]];
        }
}

/* Forces of the bank. Where an actuator has ended, its last force. */
static void forces(const Exchange *e, const double *before, double *force)
{
    for (int64_t bond = 0; bond < e->trials * e->joints; bond++)
        force[bond] = e->active[bond] ? e->y[bond * e->y_width + e->force_column] : before[bond];
}

/* The plant is to feel the forces of the last step. */
__attribute__((visibility("default"))) void push(const Exchange *e) { drive(e, e->force, e->force); }

/* After the bank's step: its forces and work, and what the plant is to feel until the end of the macro step. */
__attribute__((visibility("default"))) void felt(const Exchange *e, int64_t row, double step)
{
    double *f0 = row_of(e, F0, row), *f1 = row_of(e, F1, row);
    double *given = row_of(e, GIVEN, row), *length = row_of(e, LENGTH, row);
    forces(e, e->force, e->after);
    for (int64_t bond = 0; bond < e->trials * e->joints; bond++) {
        f0[bond] = e->force[bond];
        f1[bond] = e->after[bond];
        given[bond] = e->y[bond * e->y_width + e->work_column];
        length[bond] = step;
    }
    drive(e, e->force, e->after);
}

/* Step the bank along the motion that begins now. */
__attribute__((visibility("default"))) int begin(const Exchange *e, int64_t row, double time, double step)
{
    show(e, row_of(e, X0, row), row_of(e, V0, row));
    for (int64_t i = 0; i < e->trials; i++)
        for (int64_t k = 0; k < e->joints; k++)
            e->u[(i * e->joints + k) * e->u_width + e->at_acceleration] =
                e->acceleration[i * e->acceleration_step + e->dofs[k]];
    int status = go(e, time, step);
    if (status < 2) felt(e, row, step);
    return status;
}

/* The forces that correct those of the step, from what the actuators were last shown. */
__attribute__((visibility("default"))) void end(const Exchange *e) { forces(e, e->after, e->force); }

/* Show the bank where the pistons are now. */
__attribute__((visibility("default"))) int correct(const Exchange *e, int64_t row, double time)
{
    show(e, row_of(e, X1, row), row_of(e, V1, row));
    int status = go(e, time, 0.0);
    if (status < 2) end(e);
    return status;
}
