/* FMI 3.0, co-simulation and model exchange, over model.h. What the model does not offer is in unused3.h. */
#ifdef STANDARD_HEADERS
#include "fmi3Functions.h"
#else
#include "abi3.h"
#endif
#include "instance.h"

#if defined _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif
#define FACE(type) API type
#define REFS fmi3Instance c, const fmi3ValueReference vr[], size_t nvr

static void pass_on(void *instance, int status, const char *text)
{
    Instance *c = instance;
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)c->callback;
    if (logger) logger(c->environment, (fmi3Status)status, status > OK ? "logStatusError" : "logAll", text);
}

static fmi3Instance create(fmi3String name, fmi3String token, int co_simulation, bool logging, void *environment,
                           fmi3LogMessageCallback logger)
{
    Instance *c = calloc(1, sizeof(Instance));
    if (!c) return NULL;
    c->co_simulation = co_simulation;
    c->logging = logging;
    c->log = pass_on;
    c->environment = environment;
    c->callback = (void *)logger;
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    if (!token || strcmp(token, MODEL_TOKEN)) {
        say(c, FAILED, "the token of modelDescription.xml is not that of this binary (" MODEL_TOKEN "); build again");
        free(c);
        return NULL;
    }
    defaults(c);
    return c;
}

FACE(const char *) fmi3GetVersion(void) { return "3.0"; }

FACE(fmi3Status) fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)n; (void)categories;
    ((Instance *)c)->logging = on;
    return fmi3OK;
}

FACE(fmi3Instance) fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment env,
                                                fmi3LogMessageCallback logger)
{
    (void)resources; (void)visible;
    return create(name, token, 0, logging, env, logger);
}

FACE(fmi3Instance) fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                               fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                               size_t n_intermediate, fmi3InstanceEnvironment env,
                                               fmi3LogMessageCallback logger, fmi3IntermediateUpdateCallback update)
{
    (void)resources; (void)visible; (void)event_mode; (void)early_return;
    (void)intermediate; (void)n_intermediate; (void)update;
    return create(name, token, 1, logging, env, logger);
}

FACE(void) fmi3FreeInstance(fmi3Instance c) { free(c); }

FACE(fmi3Status) fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                             fmi3Float64 from, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance; (void)tolerance; (void)has_stop; (void)stop;
    int status = allowed(c, CREATED, "fmi3EnterInitializationMode");
    if (status == OK) {
        ((Instance *)c)->now.model.time = from;
        ((Instance *)c)->now.mode = INITIALIZING;
    }
    return (fmi3Status)status;
}

FACE(fmi3Status) fmi3ExitInitializationMode(fmi3Instance c) { return (fmi3Status)start(c); }

FACE(fmi3Status) fmi3Terminate(fmi3Instance c)
{
    int status = allowed(c, STEPPING | EVENT | CONTINUOUS, "fmi3Terminate");
    if (status == OK) ((Instance *)c)->now.mode = TERMINATED;
    return (fmi3Status)status;
}

FACE(fmi3Status) fmi3Reset(fmi3Instance c) { defaults(c); return fmi3OK; }

FACE(fmi3Status) fmi3GetFloat64(REFS, fmi3Float64 value[], size_t n)
{
    if (n != nvr) return (fmi3Status)say(c, FAILED, "fmi3GetFloat64: every variable is a scalar");
    return (fmi3Status)get_number(c, "fmi3GetFloat64", vr, nvr, REAL, value);
}

FACE(fmi3Status) fmi3SetFloat64(REFS, const fmi3Float64 value[], size_t n)
{
    if (n != nvr) return (fmi3Status)say(c, FAILED, "fmi3SetFloat64: every variable is a scalar");
    return (fmi3Status)set_number(c, "fmi3SetFloat64", vr, nvr, REAL, value);
}

FACE(fmi3Status) fmi3GetBoolean(REFS, fmi3Boolean value[], size_t n)
{
    int status = n == nvr ? OK : FAILED;
    for (size_t i = 0; i < nvr && status <= WARNING; i++) {
        double number = 0.0;
        status = get_number(c, "fmi3GetBoolean", vr + i, 1, BOOLEAN, &number);
        value[i] = number != 0.0;
    }
    return (fmi3Status)status;
}

FACE(fmi3Status) fmi3SetBoolean(REFS, const fmi3Boolean value[], size_t n)
{
    int status = n == nvr ? OK : FAILED;
    for (size_t i = 0; i < nvr && status <= WARNING; i++) {
        double number = value[i] ? 1.0 : 0.0;
        status = set_number(c, "fmi3SetBoolean", vr + i, 1, BOOLEAN, &number);
    }
    return (fmi3Status)status;
}

FACE(fmi3Status) fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)snapshot(c, state); }

FACE(fmi3Status) fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    if (!state) return fmi3Error;
    memcpy(&((Instance *)c)->now, state, sizeof(Snapshot));
    return fmi3OK;
}

FACE(fmi3Status) fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    if (state) { free(*state); *state = NULL; }
    return fmi3OK;
}

FACE(fmi3Status) fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)c; (void)state;
    *size = sizeof(Snapshot);
    return fmi3OK;
}

FACE(fmi3Status) fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (size < sizeof(Snapshot)) return (fmi3Status)say(c, FAILED, "the buffer is too small for the FMU state");
    memcpy(bytes, state, sizeof(Snapshot));
    return fmi3OK;
}

FACE(fmi3Status) fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size != sizeof(Snapshot)) return (fmi3Status)say(c, FAILED, "these bytes are not a state of this FMU");
    if (!*state && !(*state = malloc(sizeof(Snapshot)))) return fmi3Error;
    memcpy(*state, bytes, sizeof(Snapshot));
    return fmi3OK;
}

FACE(fmi3Status) fmi3DoStep(fmi3Instance c, fmi3Float64 from, fmi3Float64 step, fmi3Boolean final, fmi3Boolean *event,
                            fmi3Boolean *stop, fmi3Boolean *early, fmi3Float64 *last)
{
    (void)final;
    int status = advance(c, from, step);
    *event = *stop = *early = false;
    *last = status <= WARNING ? from + step : from;
    return (fmi3Status)status;
}

FACE(fmi3Status) fmi3EnterStepMode(fmi3Instance c) { return (fmi3Status)allowed(c, STEPPING | EVENT, "fmi3EnterStepMode"); }
FACE(fmi3Status) fmi3EnterEventMode(fmi3Instance c) { ((Instance *)c)->now.mode = EVENT; return fmi3OK; }
FACE(fmi3Status) fmi3EnterContinuousTimeMode(fmi3Instance c) { ((Instance *)c)->now.mode = CONTINUOUS; return fmi3OK; }

FACE(fmi3Status) fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *stop, fmi3Boolean *nominals,
                                          fmi3Boolean *values, fmi3Boolean *has_next, fmi3Float64 *next)
{
    Report r = {""};
    double when = HUGE_VAL;
    int status = model_event(&((Instance *)c)->now.model, &when, &r);
    *again = *stop = *nominals = *values = false;
    *has_next = when < HUGE_VAL;
    *next = when;
    return (fmi3Status)say(c, status, r.text);
}

FACE(fmi3Status) fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean final, fmi3Boolean *event, fmi3Boolean *stop)
{
    (void)c; (void)final;
    *event = *stop = false;
    return fmi3OK;
}

FACE(fmi3Status) fmi3SetTime(fmi3Instance c, fmi3Float64 time)
{
    ((Instance *)c)->now.model.time = time;
    model_touch(&((Instance *)c)->now.model, N_VARIABLES);
    return fmi3OK;
}

FACE(fmi3Status) fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n)
{
    for (size_t i = 0; i < n && i < N_STATES; i++) {
        ((Instance *)c)->now.model.value[STATES[i]] = x[i];
        model_touch(&((Instance *)c)->now.model, STATES[i]);
    }
    return n == N_STATES ? fmi3OK : fmi3Error;
}

FACE(fmi3Status) fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n)
{
    for (size_t i = 0; i < n && i < N_STATES; i++) x[i] = ((Instance *)c)->now.model.value[STATES[i]];
    return n == N_STATES ? fmi3OK : fmi3Error;
}

FACE(fmi3Status) fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n)
{
    (void)c;
    for (size_t i = 0; i < n && i < N_STATES; i++) x[i] = VARIABLES[STATES[i]].nominal;
    return n == N_STATES ? fmi3OK : fmi3Error;
}

FACE(fmi3Status) fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 rates[], size_t n)
{
    Report r = {""};
    if (n != N_STATES) return fmi3Error;
    return (fmi3Status)say(c, model_rates(&((Instance *)c)->now.model, rates, &r), r.text);
}

FACE(fmi3Status) fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n)
{
    (void)c; (void)z;
    return n ? fmi3Error : fmi3OK;
}

FACE(fmi3Status) fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) { (void)c; *n = 0; return fmi3OK; }
FACE(fmi3Status) fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) { (void)c; *n = N_STATES; return fmi3OK; }

#include "unused3.h"
