/* What a model gives to the FMI faces (face2.c, face3.c), and what they give to it.
 *
 * A model is one C file with the functions below, a header own.h with its private memory if it has any, and a table of
 * variables, fmu.toml, from which variables.h and modelDescription.xml are generated. Everything a model remembers lies in
 * `Model`, plain numbers without padding, so that a copy of it is the FMU state and a repeat is exact to the bit.
 */
#ifndef SKILLFRAME_MODEL_H
#define SKILLFRAME_MODEL_H

#include <stddef.h>

enum { PARAMETER, INPUT, OUTPUT, LOCAL, INDEPENDENT };     /* causality */
enum { REAL, BOOLEAN };                                    /* type; a boolean is held as 0.0 or 1.0 */

typedef struct {
    const char *name;
    int causality, type;
    double start, nominal;
} Variable;

#if __has_include("own.h")
#include "own.h"
#else
typedef struct { double nothing; } Own;                    /* a model that remembers nothing */
#endif
#include "variables.h"

typedef struct {
    double time;                 /* s */
    double value[N_VARIABLES];   /* every variable, by its value reference */
    Own own;                     /* the model's own memory: doubles only */
} Model;

typedef enum { OK, WARNING, DISCARD, FAILED } Outcome;     /* the status codes 0..3 of both standards */

typedef struct {
    char text[360];              /* one sentence: what, where, what to do */
} Report;

/* End of initialisation: check parameters, set states and outputs from parameters and inputs. */
Outcome model_start(Model *m, Report *r);
/* An input or state was set from outside. */
void model_touch(Model *m, unsigned variable);
/* Bring outputs up to date with the present inputs and states; no time passes. */
Outcome model_outputs(Model *m, Report *r);
/* Co-simulation: advance from m->time by `step` [s]; the face restores the model if this is not OK or WARNING. */
Outcome model_step(Model *m, double step, Report *r);
/* Model exchange: time derivatives of the states, in the order of STATES. */
Outcome model_rates(Model *m, double rates[], Report *r);
/* Model exchange: discrete changes now; the time of the next one goes to *next (HUGE_VAL: none). */
Outcome model_event(Model *m, double *next, Report *r);

#endif
