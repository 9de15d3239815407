/* FMI 2.0, co-simulation and model exchange, over model.h. */
#ifdef STANDARD_HEADERS
#include "fmi2Functions.h"
#else
#include "abi2.h"
#endif
#include "instance.h"

#if defined _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif
#define FACE(type) API type
#define REFS const fmi2ValueReference vr[], size_t nvr

static void pass_on(void *instance, int status, const char *text)
{
    Instance *c = instance;
    fmi2CallbackLogger logger = (fmi2CallbackLogger)c->callback;
    if (logger) logger(c->environment, c->name, (fmi2Status)status, status > OK ? "logStatusError" : "logAll", text);
}

FACE(const char *) fmi2GetTypesPlatform(void) { return "default"; }
FACE(const char *) fmi2GetVersion(void) { return "2.0"; }

FACE(fmi2Status) fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)n; (void)categories;
    ((Instance *)c)->logging = on;
    return fmi2OK;
}

FACE(fmi2Component) fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources; (void)visible;
    Instance *c = calloc(1, sizeof(Instance));
    if (!c) return NULL;
    c->co_simulation = type == fmi2CoSimulation;
    c->logging = logging;
    c->log = pass_on;
    c->environment = functions ? functions->componentEnvironment : NULL;
    c->callback = functions ? (void *)functions->logger : NULL;
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    if (!guid || strcmp(guid, MODEL_TOKEN)) {
        say(c, FAILED, "the GUID of modelDescription.xml is not that of this binary (" MODEL_TOKEN "); build again");
        free(c);
        return NULL;
    }
    defaults(c);
    return c;
}

FACE(void) fmi2FreeInstance(fmi2Component c) { free(c); }

FACE(fmi2Status) fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real from,
                                     fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance; (void)tolerance; (void)has_stop; (void)stop;
    int status = allowed(c, CREATED, "fmi2SetupExperiment");
    if (status == OK) ((Instance *)c)->now.model.time = from;
    return (fmi2Status)status;
}

FACE(fmi2Status) fmi2EnterInitializationMode(fmi2Component c)
{
    int status = allowed(c, CREATED, "fmi2EnterInitializationMode");
    if (status == OK) ((Instance *)c)->now.mode = INITIALIZING;
    return (fmi2Status)status;
}

FACE(fmi2Status) fmi2ExitInitializationMode(fmi2Component c) { return (fmi2Status)start(c); }

FACE(fmi2Status) fmi2Terminate(fmi2Component c)
{
    int status = allowed(c, STEPPING | EVENT | CONTINUOUS, "fmi2Terminate");
    if (status == OK) ((Instance *)c)->now.mode = TERMINATED;
    return (fmi2Status)status;
}

FACE(fmi2Status) fmi2Reset(fmi2Component c) { defaults(c); return fmi2OK; }

FACE(fmi2Status) fmi2GetReal(fmi2Component c, REFS, fmi2Real value[])
{
    return (fmi2Status)get_number(c, "fmi2GetReal", vr, nvr, REAL, value);
}

FACE(fmi2Status) fmi2SetReal(fmi2Component c, REFS, const fmi2Real value[])
{
    return (fmi2Status)set_number(c, "fmi2SetReal", vr, nvr, REAL, value);
}

FACE(fmi2Status) fmi2GetBoolean(fmi2Component c, REFS, fmi2Boolean value[])
{
    int status = OK;
    for (size_t i = 0; i < nvr && status <= WARNING; i++) {
        double number = 0.0;
        status = get_number(c, "fmi2GetBoolean", vr + i, 1, BOOLEAN, &number);
        value[i] = number != 0.0;
    }
    return (fmi2Status)status;
}

FACE(fmi2Status) fmi2SetBoolean(fmi2Component c, REFS, const fmi2Boolean value[])
{
    int status = OK;
    for (size_t i = 0; i < nvr && status <= WARNING; i++) {
        double number = value[i] ? 1.0 : 0.0;
        status = set_number(c, "fmi2SetBoolean", vr + i, 1, BOOLEAN, &number);
    }
    return (fmi2Status)status;
}

/* This model has no variables of these types: asking for none is fine, for one is an error. */
#define NONE(name, type) \
    FACE(fmi2Status) name(fmi2Component c, REFS, type value[]) \
    { (void)value; return nvr ? (fmi2Status)refuse_variable(c, #name, vr[0], "has another type") : fmi2OK; }
NONE(fmi2GetInteger, fmi2Integer)
NONE(fmi2SetInteger, const fmi2Integer)
NONE(fmi2GetString, fmi2String)
NONE(fmi2SetString, const fmi2String)

FACE(fmi2Status) fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return (fmi2Status)snapshot(c, state); }

FACE(fmi2Status) fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    if (!state) return fmi2Error;
    memcpy(&((Instance *)c)->now, state, sizeof(Snapshot));
    return fmi2OK;
}

FACE(fmi2Status) fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    if (state) { free(*state); *state = NULL; }
    return fmi2OK;
}

FACE(fmi2Status) fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c; (void)state;
    *size = sizeof(Snapshot);
    return fmi2OK;
}

FACE(fmi2Status) fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(Snapshot)) return (fmi2Status)say(c, FAILED, "the buffer is too small for the FMU state");
    memcpy(bytes, state, sizeof(Snapshot));
    return fmi2OK;
}

FACE(fmi2Status) fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(Snapshot)) return (fmi2Status)say(c, FAILED, "these bytes are not a state of this FMU");
    if (!*state && !(*state = malloc(sizeof(Snapshot)))) return fmi2Error;
    memcpy(*state, bytes, sizeof(Snapshot));
    return fmi2OK;
}

FACE(fmi2Status) fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                              const fmi2ValueReference known[], size_t m, const fmi2Real seed[],
                                              fmi2Real sensitivity[])
{
    (void)unknown; (void)n; (void)known; (void)m; (void)seed; (void)sensitivity;
    return (fmi2Status)say(c, FAILED, "directional derivatives are not provided, as modelDescription.xml says");
}

/* co-simulation */

FACE(fmi2Status) fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real step, fmi2Boolean final)
{
    (void)final;
    return (fmi2Status)advance(c, from, step);
}

FACE(fmi2Status) fmi2CancelStep(fmi2Component c)
{
    return (fmi2Status)say(c, FAILED, "fmi2CancelStep: steps are never asynchronous here");
}

FACE(fmi2Status) fmi2SetRealInputDerivatives(fmi2Component c, REFS, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr; (void)nvr; (void)order; (void)value;
    return (fmi2Status)say(c, FAILED, "input derivatives are not taken, as modelDescription.xml says");
}

FACE(fmi2Status) fmi2GetRealOutputDerivatives(fmi2Component c, REFS, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr; (void)nvr; (void)order; (void)value;
    return (fmi2Status)say(c, FAILED, "output derivatives are not provided, as modelDescription.xml says");
}

FACE(fmi2Status) fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->now.model.time;
    return fmi2OK;
}

FACE(fmi2Status) fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

FACE(fmi2Status) fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

FACE(fmi2Status) fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

FACE(fmi2Status) fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

/* model exchange */

FACE(fmi2Status) fmi2EnterEventMode(fmi2Component c) { ((Instance *)c)->now.mode = EVENT; return fmi2OK; }
FACE(fmi2Status) fmi2EnterContinuousTimeMode(fmi2Component c) { ((Instance *)c)->now.mode = CONTINUOUS; return fmi2OK; }

FACE(fmi2Status) fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    Report r = {""};
    double next = HUGE_VAL;
    int status = model_event(&((Instance *)c)->now.model, &next, &r);
    memset(info, 0, sizeof *info);
    info->nextEventTimeDefined = next < HUGE_VAL;
    info->nextEventTime = next;
    return (fmi2Status)say(c, status, r.text);
}

FACE(fmi2Status) fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean final, fmi2Boolean *event, fmi2Boolean *stop)
{
    (void)c; (void)final;
    *event = *stop = 0;
    return fmi2OK;
}

FACE(fmi2Status) fmi2SetTime(fmi2Component c, fmi2Real time)
{
    ((Instance *)c)->now.model.time = time;
    model_touch(&((Instance *)c)->now.model, N_VARIABLES);
    return fmi2OK;
}

FACE(fmi2Status) fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n)
{
    for (size_t i = 0; i < n && i < N_STATES; i++) {
        ((Instance *)c)->now.model.value[STATES[i]] = x[i];
        model_touch(&((Instance *)c)->now.model, STATES[i]);
    }
    return n == N_STATES ? fmi2OK : fmi2Error;
}

FACE(fmi2Status) fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n)
{
    for (size_t i = 0; i < n && i < N_STATES; i++) x[i] = ((Instance *)c)->now.model.value[STATES[i]];
    return n == N_STATES ? fmi2OK : fmi2Error;
}

FACE(fmi2Status) fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n)
{
    (void)c;
    for (size_t i = 0; i < n && i < N_STATES; i++) x[i] = VARIABLES[STATES[i]].nominal;
    return n == N_STATES ? fmi2OK : fmi2Error;
}

FACE(fmi2Status) fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n)
{
    Report r = {""};
    if (n != N_STATES) return fmi2Error;
    return (fmi2Status)say(c, model_rates(&((Instance *)c)->now.model, rates, &r), r.text);
}

FACE(fmi2Status) fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n)
{
    (void)c; (void)z;
    return n ? fmi2Error : fmi2OK;
}
