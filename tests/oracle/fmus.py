"""FMUs written by hand from the text of FMI 2.0 and 3.0: model descriptions, C for gcc, zips. No skillframe code.

Both are the lag dx/dt = n (u + shift - x), stepped exactly over h with a held input,

    x(t + h) = u + shift + (x(t) - u - shift) exp(-n h)                                                        (1)

so that every step size gives the same numbers, and every kind of variable acts on them.
"""

import re
import subprocess
import zipfile
from pathlib import Path

GUID = "{8c4e810f-3df3-4a00-8276-176fa3c9f000}"
HERE = {2: "linux64", 3: "x86_64-linux"}
C2 = r"""
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "fmi2Functions.h"
#ifndef ON_STEP
#define ON_STEP
#endif
#ifndef ON_SETUP
#define ON_SETUP
#endif
#ifndef ON_END
#define ON_END
#endif
#ifndef ON_FREE
#define ON_FREE
#endif
typedef fmi2Component C;
typedef fmi2Status S;
typedef struct { double u, x, gain, t, offset; int n, on, count, shift; char label[64]; } M;
S fmi2SetDebugLogging(C c, int on, size_t n, const fmi2String s[]) { return fmi2OK; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
C fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where, const fmi2CallbackFunctions *calls,
                  int visible, int on) {
    M *m = calloc(1, sizeof *m);
    m->gain = 2, m->n = 1, m->on = 1;
    strcpy(m->label, "hello");
#ifdef RESOURCE
    char path[4096];
    snprintf(path, sizeof path, "%s/sub folder/deep/offset.txt", strncmp(where, "file://", 7) ? where : where + 7);
    FILE *f = fopen(path, "r");
    if (!f || fscanf(f, "%lf", &m->offset) != 1) return NULL;
    fclose(f);
#endif
    return m;
}
void fmi2FreeInstance(C c) { ON_FREE free(c); }
S fmi2SetupExperiment(C c, int a, double b, double start, int d, double e) {
    ON_SETUP ((M *)c)->t = start;
    return fmi2OK;
}
S fmi2EnterInitializationMode(C c) { return fmi2OK; }
S fmi2ExitInitializationMode(C c) { return fmi2OK; }
S fmi2Terminate(C c) { ON_END return fmi2OK; }
S fmi2Reset(C c) { return fmi2OK; }
#define ACCESS(T, V, ...) S fmi2##T(C c, const unsigned r[], size_t n, V v[]) { M *m = c; \
    for (size_t k = 0; k < n; k++) switch (r[k]) { __VA_ARGS__ default: return fmi2Error; } return fmi2OK; }
ACCESS(GetReal, double, case 0: v[k] = m->u; break; case 1: v[k] = m->gain * m->x + m->offset; break;)
ACCESS(SetReal, const double, case 0: m->u = v[k]; break; case 2: m->gain = v[k]; break;)
ACCESS(GetInteger, int, case 1: v[k] = m->count; break;)
ACCESS(SetInteger, const int, case 0: m->n = v[k]; break; case 2: m->shift = v[k]; break;)
ACCESS(GetBoolean, int, case 1: v[k] = m->x > 0.5; break;)
ACCESS(SetBoolean, const int, case 0: m->on = v[k]; break;)
ACCESS(GetString, fmi2String, case 1: v[k] = m->label; break;)
ACCESS(SetString, const fmi2String, case 0: snprintf(m->label, 64, "%s", v[k]); break;)
S fmi2DoStep(C c, double t, double h, int no) {
    M *m = c;
    ON_STEP
    double to = m->on ? m->u + m->shift : 0.0;
    m->x = to + (m->x - to) * exp(-h * m->n), m->t = t + h, m->count++;
    return fmi2OK;
}
S fmi2GetBooleanStatus(C c, const fmi2StatusKind k, int *v) { *v = 1; return fmi2OK; }
S fmi2GetRealStatus(C c, const fmi2StatusKind k, double *v) { *v = ((M *)c)->t; return fmi2OK; }
"""
VARIABLES = """
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0" unit="N"/></ScalarVariable>
<ScalarVariable name="{out}" valueReference="1" causality="output"><Real unit="N"/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="tunable"><Real start="2"/></ScalarVariable>
<ScalarVariable name="n" valueReference="0" causality="parameter" variability="fixed"><Integer start="1"/></ScalarVariable>
<ScalarVariable name="label" valueReference="0" causality="parameter" variability="fixed"><String start="hello"/></ScalarVariable>
<ScalarVariable name="high" valueReference="1" causality="output" variability="discrete"><Boolean/></ScalarVariable>
<ScalarVariable name="count" valueReference="1" causality="output" variability="discrete"><Integer/></ScalarVariable>
<ScalarVariable name="echo" valueReference="1" causality="output" variability="discrete"><String/></ScalarVariable>
<ScalarVariable name="shift" valueReference="2" causality="input" variability="discrete"><Integer start="0"/></ScalarVariable>
<ScalarVariable name="on" valueReference="0" causality="input" variability="discrete"><Boolean start="true"/></ScalarVariable>
"""  # noqa: E501
XML2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{guid}" numberOfEventIndicators="0">
<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="{variable}">{sources}</CoSimulation>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit></UnitDefinitions>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>
</fmiModelDescription>"""
C3 = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi3Functions.h"
#ifndef ON_STEP
#define ON_STEP
#endif
typedef fmi3Instance C;
typedef fmi3Status S;
typedef struct { double u, x[6], w[3], t; int8_t small; uint64_t large; } M;
C fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, bool visible, bool on, bool events,
    bool early, const fmi3ValueReference r[], size_t n, fmi3InstanceEnvironment e, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update) {
    M *m = calloc(1, sizeof *m);
    for (int i = 0; i < 3; i++) m->w[i] = i + 1;
    m->small = -5, m->large = 18446744073709551615ull;
    return m;
}
void fmi3FreeInstance(C c) { free(c); }
const char *fmi3GetVersion(void) { return "3.0"; }
S fmi3EnterInitializationMode(C c, bool d, double e, double t, bool s, double end) { ((M *)c)->t = t; return fmi3OK; }
S fmi3ExitInitializationMode(C c) { return fmi3OK; }
S fmi3Terminate(C c) { return fmi3OK; }
#define ACCESS(T, V, ...) S fmi3##T(C c, const fmi3ValueReference r[], size_t nr, V v[], size_t n) { M *m = c; \
    size_t at = 0; for (size_t k = 0; k < nr; k++) switch (r[k]) { __VA_ARGS__ default: return fmi3Error; } \
    return at == n ? fmi3OK : fmi3Error; }
ACCESS(GetFloat64, double, case 2: for (int i = 0; i < 6; i++) v[at++] = m->x[i]; break;
    case 4: v[at++] = m->x[0]; break;)
ACCESS(SetFloat64, const double, case 1: m->u = v[at++]; break;
    case 3: for (int i = 0; i < 3; i++) m->w[i] = v[at++]; break;)
ACCESS(GetInt8, int8_t, case 21: v[at++] = m->small; break;)
ACCESS(SetInt8, const int8_t, case 20: m->small = v[at++]; break;)
ACCESS(GetUInt64, uint64_t, case 30: v[at++] = m->large; break;)
S fmi3DoStep(C c, double t, double h, bool no, bool *event, bool *end, bool *early, double *last) {
    M *m = c;
    *event = *end = *early = false, *last = t + h;
    ON_STEP
    for (int i = 0; i < 6; i++) m->x[i] = m->u + (m->x[i] - m->u) * exp(-h * m->w[i % 3]);
    m->t = t + h;
    return fmi3OK;
}
"""
XML3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="lags" instantiationToken="{guid}">
<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="{variable}"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="1" causality="input" start="0"/>
<Float64 name="x" valueReference="2" causality="output"><Dimension start="2"/><Dimension start="{columns}"/></Float64>
<Float64 name="w" valueReference="3" causality="parameter" variability="tunable" start="1 2 3"><Dimension start="3"/></Float64>
<Float64 name="first" valueReference="4" causality="output"><Alias name="erstes" description="the same"/></Float64>
<Int8 name="small" valueReference="20" causality="parameter" variability="fixed" start="-5"/>
<Int8 name="small_out" valueReference="21" causality="output"/>
<UInt64 name="large" valueReference="30" causality="output"/>
</ModelVariables>
<ModelStructure>{unknowns}</ModelStructure></fmiModelDescription>"""  # noqa: E501


def describe(version=2, out="y", variable="true", sources="", columns=3, guid=GUID):
    """A model description."""
    if version == 2:
        unknowns = "".join(f'<Unknown index="{i}"/>' for i in (2, 6, 7, 8))
        return XML2.format(
            guid=guid, variable=variable, sources=sources, variables=VARIABLES.format(out=out), unknowns=unknowns
        )
    kinds = ("Output", "InitialUnknown")
    unknowns = "".join(f'<{kind} valueReference="{k}"/>' for kind in kinds for k in (2, 4, 21, 30))
    return XML3.format(guid=guid, variable=variable, columns=columns, unknowns=unknowns)


def source(version=2):
    """C that has every function of the standard: ours, and for the rest one that fails."""
    import fmpy

    ours = C2 if version == 2 else C3
    types = (Path(fmpy.__file__).parent / "c-code" / f"fmi{version}FunctionTypes.h").read_text()
    types = re.sub(r"/\*.*?\*/", "", types, flags=re.S)
    made = set(re.findall(rf"\b(fmi{version}\w+)\(", ours))
    made |= {f"fmi{version}{name}" for name in re.findall(r"ACCESS\((\w+),", ours)}
    for back, name, given in re.findall(rf"typedef\s+(\w+\*?)\s+(fmi{version}\w+)TYPE\s*\(([^;]*)\)\s*;", types):
        if name not in made and not name.startswith((f"fmi{version}Callback", "fmi3Clock")) and "Callback" not in name:
            ours += f"\n{back} {name}({' '.join(given.split())}) {{ {'' if back == 'void' else 'return 3;'} }}"
    return ours


def library(folder: Path, version=2, prelude="", **hooks):
    """The shared library of `source` after a prelude in C, hooks as preprocessor definitions."""
    return compiled(folder, prelude + source(version), **hooks)


def compiled(folder: Path, code, **hooks):
    """The shared library of some C."""
    import fmpy

    folder.mkdir(parents=True, exist_ok=True)
    made, text = folder / "lag.so", folder / "lag.c"
    text.write_text(code)
    include = f"-I{Path(fmpy.__file__).parent / 'c-code'}"
    defines = [f"-D{name}={text}" for name, text in hooks.items()]
    command = ["gcc", "-shared", "-fPIC", "-O1", "-w", include, *defines, "-o", str(made), str(text), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return made.read_bytes()


def pack(path: Path, description=None, binary=None, version=2, members=()):
    """The zip of members (name or ZipInfo, content)."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        if description is not None:
            file.writestr("modelDescription.xml", description)
        if binary is not None:
            file.writestr(f"binaries/{HERE[version]}/lag.so", binary)
        for name, content in members:
            file.writestr(name, content)
    return path
