/* One call per macro step for any number of FMU instances of both versions: set inputs, step, get outputs, check.
 *
 * Everything is prepared in Python (driver.py): function pointers, value references, and where each number comes from.
 * Statuses: 0 to 4 as in the standard, 5 an output is not finite, 6 the FMU asks to end. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LARGEST 64

typedef struct {
    void *component;
    void *set, *get, *step;
    const uint32_t *in_refs, *out_refs;
    const int64_t *in_columns, *out_columns;
    const double *u;
    double *y;
    int64_t n_in, n_out, version, status;
} Slot;

typedef int (*Set2)(void *, const uint32_t *, size_t, const double *);
typedef int (*Get2)(void *, const uint32_t *, size_t, double *);
typedef int (*Step2)(void *, double, double, int);
typedef int (*Set3)(void *, const uint32_t *, size_t, const double *, size_t);
typedef int (*Get3)(void *, const uint32_t *, size_t, double *, size_t);
typedef int (*Step3)(void *, double, double, bool, bool *, bool *, bool *, double *);

static int put(const Slot *s)
{
    double values[LARGEST];
    size_t n = (size_t)s->n_in;
    if (!n) return 0;
    for (size_t i = 0; i < n; i++) values[i] = s->u[s->in_columns[i]];
    if (s->version == 2) return ((Set2)s->set)(s->component, s->in_refs, n, values);
    return ((Set3)s->set)(s->component, s->in_refs, n, values, n);
}

static int take(const Slot *s)
{
    double values[LARGEST];
    size_t n = (size_t)s->n_out;
    int status = s->version == 2 ? ((Get2)s->get)(s->component, s->out_refs, n, values)
                                 : ((Get3)s->get)(s->component, s->out_refs, n, values, n);
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i]) && status < 2) status = 5;
        s->y[s->out_columns[i]] = values[i];
    }
    return status;
}

static int go(const Slot *s, double time, double step)
{
    bool event = false, stop = false, early = false;
    double last = time;
    if (s->version == 2) return ((Step2)s->step)(s->component, time, step, 1);
    int status = ((Step3)s->step)(s->component, time, step, true, &event, &stop, &early, &last);
    if (status < 2 && early) return 2;
    return status < 2 && stop ? 6 : status;
}

static int larger(int a, int b) { return a > b ? a : b; }

/* Step every active slot; returns the worst status. A step of zero only refreshes the outputs. */
__attribute__((visibility("default"))) int skillframe_step(Slot *slots, size_t n, const uint8_t *active, double time,
                                                           double step)
{
    int worst = 0;
    for (size_t i = 0; i < n; i++) {
        Slot *s = slots + i;
        if (!active[i]) continue;
        int status = put(s);
        if (status < 2 && step > 0.0) status = larger(status, go(s, time, step));
        if (status < 2) status = larger(status, take(s));
        s->status = status;
        worst = larger(worst, status);
    }
    return worst;
}
