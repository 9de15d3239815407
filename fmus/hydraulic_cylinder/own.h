/* The cylinder's private memory: doubles only, so that a copy holds no padding. */
#ifndef SKILLFRAME_OWN_H
#define SKILLFRAME_OWN_H

typedef struct {
    /* from parameters */
    double area_a, area_b, edge, cushion, counterbalance, omega, stiffness;
    /* the command the spool follows: from `demand` at `demand_time` to `target`, no faster than spool_slew */
    double target, demand, demand_time;
    /* piston motion the outputs are for */
    double position, velocity;
    double stale;     /* 1 when outputs must be computed again */
} Own;

#endif
