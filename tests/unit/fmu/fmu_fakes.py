"""Small FMUs of our own, written and built in the tests: one that behaves and several that do not."""

import zipfile
from pathlib import Path

import numpy as np

from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import build_fmu
from skillframe.fmu.driver import FmuBank

TABLE = """
name = "{name}"
sources = ["{name}.c"]
[units]
"m" = {{ m = 1 }}
[input]
command = {{ start = 0 }}
velocity = {{ start = 0 }}
[output]
force = {{ }}
lag = {{ }}
[parameter]
gain = {{ start = 2 }}
sign = {{ boolean = true, start = 1 }}
"""
OWN = "typedef struct { double lag; } Own;\n"
SOURCE = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "model.h"
Outcome model_start(Model *m, Report *r) {{ (void)r; m->own.lag = 0.0; return model_outputs(m, r); }}
void model_touch(Model *m, unsigned v) {{ (void)m; (void)v; }}
Outcome model_outputs(Model *m, Report *r) {{
    (void)r;
    double g = m->value[SIGN] != 0.0 ? m->value[GAIN] : -m->value[GAIN];
    m->value[FORCE] = g * m->value[COMMAND] - m->value[VELOCITY];
    m->value[LAG] = m->own.lag;
    return OK;
}}
Outcome model_step(Model *m, double h, Report *r) {{
    (void)r;
    {step}
    m->own.lag += h * (m->value[COMMAND] - m->own.lag);
    return model_outputs(m, r);
}}
Outcome model_rates(Model *m, double x[], Report *r) {{ (void)m; (void)x; (void)r; return OK; }}
Outcome model_event(Model *m, double *next, Report *r) {{ (void)m; (void)next; (void)r; return OK; }}
"""
MISCHIEF = {
    "good": "",
    "trusted": "",
    "crash": 'if (m->time > 0.0045) { volatile int *p = NULL; *p = 1; }',
    "hang": "if (m->time > 0.0045) for (;;) sleep(1);",
    "nan": "if (m->time > 0.0045) { m->own.lag = 0.0 / 0.0; return model_outputs(m, r); }",
    "leak": "static char *volatile kept; kept = malloc(200000000); memset(kept, 1, 200000000);",
    "refuse": 'if (m->time > 0.0045) { snprintf(r->text, sizeof r->text, "the seal is worn"); return DISCARD; }',
    "leave": "if (m->time > 0.0045) exit(7);",
}  # fmt: skip


def make(folder: Path, kind: str, version: int = 2) -> Path:
    """A foreign FMU of a kind of mischief, outside the cache, so not allowed in-process."""
    source = folder / kind
    source.mkdir(parents=True, exist_ok=True)
    (source / "fmu.toml").write_text(TABLE.format(name=kind))
    (source / "own.h").write_text(OWN)
    (source / f"{kind}.c").write_text(SOURCE.format(step=MISCHIEF[kind]))
    return build_fmu(source, version, out=folder / f"{kind}{version}.fmu")


def repacked(path: Path, out: Path, drop=lambda name: False, rename=lambda name: name, add=()) -> Path:
    """A copy of a zip with members dropped, renamed or added."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if not drop(name):
                new.writestr(rename(name), old.read(name))
        for name, data in add:
            new.writestr(name, data)
    return out


def bank(facts, *parameters, **options) -> FmuBank:
    """A bank of our cylinder with one instance per parameter set, at mid stroke, not started."""
    sets = parameters or ({},)
    made = FmuBank([ActuatorSpec(fmu="hydraulic_cylinder", parameters=p) for p in sets], [facts] * len(sets), **options)
    made.u[:, 1] = 0.3
    return made


class Swing:
    """Smooth piston motion x = 0.3 + A sin(w t), with its derivatives."""

    def __init__(self, amplitude=0.05, hertz=2.0):
        self.a, self.w = amplitude, 2 * np.pi * hertz

    def at(self, t):
        return (
            0.3 + self.a * np.sin(self.w * t),
            self.a * self.w * np.cos(self.w * t),
            -self.a * self.w**2 * np.sin(self.w * t),
        )
