/* One instance of the model and its mode, shared by both faces. */
#ifndef SKILLFRAME_INSTANCE_H
#define SKILLFRAME_INSTANCE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

enum { CREATED = 1, INITIALIZING = 2, STEPPING = 4, EVENT = 8, CONTINUOUS = 16, TERMINATED = 32, BROKEN = 64 };

typedef struct {
    Model model;
    double mode;                 /* one of the above; a double keeps the snapshot free of padding */
} Snapshot;

typedef struct {
    Snapshot now;
    int co_simulation, logging;
    void *environment;
    void (*log)(void *instance, int status, const char *text);
    void *callback;              /* the importer's logger; its type is known to the face */
    char name[128];
} Instance;

static void defaults(Instance *c)
{
    memset(&c->now, 0, sizeof c->now);
    for (unsigned i = 0; i < N_VARIABLES; i++) c->now.model.value[i] = VARIABLES[i].start;
    c->now.mode = CREATED;
}

static int say(Instance *c, int status, const char *text)
{
    if (text[0] && c->log && (c->logging || status > OK)) c->log(c, status, text);
    return status;
}

/* Status of a call that is only allowed in some modes. */
static int allowed(Instance *c, int modes, const char *call)
{
    char text[200];
    if (!c) return FAILED;
    if ((int)c->now.mode & modes) return OK;
    snprintf(text, sizeof text, "%s is not allowed now (mode %d); follow the order of calls of the standard", call,
             (int)c->now.mode);
    return say(c, FAILED, text);
}

static int refuse_variable(Instance *c, const char *call, unsigned reference, const char *why)
{
    char text[240];
    snprintf(text, sizeof text, "%s: variable %u (%s) %s", call, reference,
             reference < N_VARIABLES ? VARIABLES[reference].name : "unknown", why);
    return say(c, FAILED, text);
}

/* May this variable be set in the present mode? */
static const char *why_not_set(const Instance *c, unsigned reference, int type)
{
    if (reference >= N_VARIABLES) return "does not exist";
    if (VARIABLES[reference].type != type) return "has another type";
    int before = (int)c->now.mode & (CREATED | INITIALIZING);
    switch (VARIABLES[reference].causality) {
    case INPUT: return NULL;
    case PARAMETER: return before ? NULL : "is a parameter, fixed after initialisation; reset the instance first";
    default: return "is not an input or parameter";
    }
}

static int up_to_date(Instance *c)
{
    Report r = {""};
    if ((int)c->now.mode & (CREATED | BROKEN)) return OK;
    int status = (int)c->now.mode == INITIALIZING ? model_start(&c->now.model, &r) : model_outputs(&c->now.model, &r);
    return say(c, status, r.text);
}

static int get_number(Instance *c, const char *call, const unsigned reference[], size_t n, int type, double value[])
{
    if (!c) return FAILED;
    int status = up_to_date(c);
    for (size_t i = 0; i < n; i++) {
        if (reference[i] >= N_VARIABLES) return refuse_variable(c, call, reference[i], "does not exist");
        if (VARIABLES[reference[i]].type != type) return refuse_variable(c, call, reference[i], "has another type");
        value[i] = VARIABLES[reference[i]].causality == INDEPENDENT ? c->now.model.time
                                                                    : c->now.model.value[reference[i]];
    }
    return status;
}

static int set_number(Instance *c, const char *call, const unsigned reference[], size_t n, int type,
                      const double value[])
{
    if (!c) return FAILED;
    for (size_t i = 0; i < n; i++) {
        const char *why = why_not_set(c, reference[i], type);
        if (why) return refuse_variable(c, call, reference[i], why);
        if (!isfinite(value[i])) return refuse_variable(c, call, reference[i], "was given a value that is not finite");
        c->now.model.value[reference[i]] = value[i];
        model_touch(&c->now.model, reference[i]);
    }
    return OK;
}

static int start(Instance *c)
{
    Report r = {""};
    int status = allowed(c, INITIALIZING, "exit initialisation");
    if (status > WARNING) return status;
    status = model_start(&c->now.model, &r);
    if (status <= WARNING) c->now.mode = c->co_simulation ? STEPPING : EVENT;
    return say(c, status, r.text);
}

/* A step that fails leaves the instance as it was before, so that a shorter one can be tried. */
static int advance(Instance *c, double from, double step)
{
    Report r = {""};
    int status = allowed(c, STEPPING, "a step");
    if (status > WARNING) return status;
    if (!(step > 0.0) || !isfinite(step) || !isfinite(from)) {
        snprintf(r.text, sizeof r.text, "a step of %g s from %g s is impossible; give a positive, finite step", step, from);
        return say(c, FAILED, r.text);
    }
    Model before = c->now.model;
    c->now.model.time = from;
    status = model_step(&c->now.model, step, &r);
    if (status > WARNING) c->now.model = before;
    else c->now.model.time = from + step;
    return say(c, status, r.text);
}

static int snapshot(const Instance *c, void **copy)
{
    if (!*copy && !(*copy = malloc(sizeof(Snapshot)))) return FAILED;
    memcpy(*copy, &c->now, sizeof(Snapshot));
    return OK;
}

#endif
