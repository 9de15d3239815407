/* A drum with a motor: its force falls with its speed. What a model has to offer is in model.h. */

#include "model.h"
Outcome model_start(Model *m, Report *r) { return model_outputs(m, r); }
void model_touch(Model *m, unsigned variable) { (void)m; (void)variable; }
Outcome model_outputs(Model *m, Report *r)
{
    (void)r;
    m->value[FORCE] = m->value[STALL] * m->value[COMMAND] - m->value[DRAG] * m->value[VELOCITY];
    return OK;
}
Outcome model_step(Model *m, double step, Report *r) { (void)step; return model_outputs(m, r); }
Outcome model_rates(Model *m, double rates[], Report *r) { (void)m; (void)rates; (void)r; return OK; }
Outcome model_event(Model *m, double *next, Report *r) { (void)m; (void)next; (void)r; return OK; }
