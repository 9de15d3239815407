/* Functions of FMI 3.0 that every binary must export and that these models do not offer. */
#define NONE(name, type) \
    FACE(fmi3Status) name(REFS, type value[], size_t n) \
    { (void)value; (void)n; return nvr ? (fmi3Status)refuse_variable(c, #name, vr[0], "has another type") : fmi3OK; }
NONE(fmi3GetFloat32, fmi3Float32)
NONE(fmi3SetFloat32, const fmi3Float32)
NONE(fmi3GetInt8, fmi3Int8)
NONE(fmi3SetInt8, const fmi3Int8)
NONE(fmi3GetUInt8, fmi3UInt8)
NONE(fmi3SetUInt8, const fmi3UInt8)
NONE(fmi3GetInt16, fmi3Int16)
NONE(fmi3SetInt16, const fmi3Int16)
NONE(fmi3GetUInt16, fmi3UInt16)
NONE(fmi3SetUInt16, const fmi3UInt16)
NONE(fmi3GetInt32, fmi3Int32)
NONE(fmi3SetInt32, const fmi3Int32)
NONE(fmi3GetUInt32, fmi3UInt32)
NONE(fmi3SetUInt32, const fmi3UInt32)
NONE(fmi3GetInt64, fmi3Int64)
NONE(fmi3SetInt64, const fmi3Int64)
NONE(fmi3GetUInt64, fmi3UInt64)
NONE(fmi3SetUInt64, const fmi3UInt64)
NONE(fmi3GetString, fmi3String)
NONE(fmi3SetString, const fmi3String)

#define ABSENT(name, ...) \
    FACE(fmi3Status) name(fmi3Instance c, __VA_ARGS__) \
    { return (fmi3Status)say(c, FAILED, #name " is not offered, as modelDescription.xml says"); }
#define VRS const fmi3ValueReference vr[], size_t nvr
ABSENT(fmi3GetBinary, VRS, size_t s[], fmi3Binary v[], size_t n)
ABSENT(fmi3SetBinary, VRS, const size_t s[], const fmi3Binary v[], size_t n)
ABSENT(fmi3GetClock, VRS, fmi3Clock v[])
ABSENT(fmi3SetClock, VRS, const fmi3Clock v[])
ABSENT(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
ABSENT(fmi3GetVariableDependencies, fmi3ValueReference r, size_t e[], fmi3ValueReference i[], size_t f[],
       fmi3DependencyKind k[], size_t n)
ABSENT(fmi3GetDirectionalDerivative, VRS, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[], size_t ns,
       fmi3Float64 d[], size_t nd)
ABSENT(fmi3GetAdjointDerivative, VRS, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[], size_t ns,
       fmi3Float64 d[], size_t nd)
ABSENT(fmi3GetIntervalDecimal, VRS, fmi3Float64 i[], fmi3IntervalQualifier q[])
ABSENT(fmi3GetIntervalFraction, VRS, fmi3UInt64 i[], fmi3UInt64 r[], fmi3IntervalQualifier q[])
ABSENT(fmi3GetShiftDecimal, VRS, fmi3Float64 s[])
ABSENT(fmi3GetShiftFraction, VRS, fmi3UInt64 i[], fmi3UInt64 r[])
ABSENT(fmi3SetIntervalDecimal, VRS, const fmi3Float64 i[])
ABSENT(fmi3SetIntervalFraction, VRS, const fmi3UInt64 i[], const fmi3UInt64 r[])
ABSENT(fmi3SetShiftDecimal, VRS, const fmi3Float64 s[])
ABSENT(fmi3SetShiftFraction, VRS, const fmi3UInt64 i[], const fmi3UInt64 r[])
ABSENT(fmi3GetOutputDerivatives, VRS, const fmi3Int32 o[], fmi3Float64 v[], size_t n)
ABSENT(fmi3ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)

FACE(fmi3Status) fmi3EnterConfigurationMode(fmi3Instance c)
{
    return (fmi3Status)say(c, FAILED, "there are no structural parameters to configure");
}

FACE(fmi3Status) fmi3ExitConfigurationMode(fmi3Instance c)
{
    return (fmi3Status)say(c, FAILED, "there are no structural parameters to configure");
}

FACE(fmi3Status) fmi3EvaluateDiscreteStates(fmi3Instance c) { (void)c; return fmi3OK; }

FACE(fmi3Instance) fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean logging,
                                                     fmi3InstanceEnvironment env, fmi3LogMessageCallback logger,
                                                     fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                                     fmi3UnlockPreemptionCallback unlock)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)clock; (void)lock; (void)unlock;
    if (logger) logger(env, fmi3Error, "logStatusError", "scheduled execution is not offered");
    return NULL;
}
