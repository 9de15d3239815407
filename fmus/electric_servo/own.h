/* The servo's private memory: doubles only, so that a copy holds no padding. */
#ifndef SKILLFRAME_OWN_H
#define SKILLFRAME_OWN_H

typedef struct {
    double inertia, per_ampere;    /* from parameters: on the joint's side [kg m^2], [N m/A] */
    double position, velocity;     /* joint motion that the outputs are for */
    double stale;                  /* 1 when outputs must be computed again */
} Own;

#endif
