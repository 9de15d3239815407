"""Robots like hiab_xs031 with something wrong, and FMUs that sit in its cylinders and misbehave."""

from __future__ import annotations

import re
from pathlib import Path

from skillframe_testkit.suites import example_demonstrations

from skillframe.document.file import learned, save
from skillframe.extend.registry import registry
from skillframe.fmu.build import build_fmu
from skillframe.robot.spec import load_robot

CRANE = load_robot("hiab_xs031").folder
TABLE = """
name = "{name}"
sources = ["{name}.c"]
[units]
"m" = {{ m = 1 }}
[input]
command = {{ start = 0 }}
position = {{ start = 0 }}
velocity = {{ start = 0 }}
[output]
force = {{ }}
work = {{ }}
pressure_a = {{ }}
pressure_b = {{ }}
[parameter]
{parameters}
"""
OWN = "typedef struct { double begin, work, force; int started; } Own;\n"
SOURCE = """
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "model.h"
Outcome model_start(Model *m, Report *r) {{ memset(&m->own, 0, sizeof m->own); return model_outputs(m, r); }}
void model_touch(Model *m, unsigned v) {{ (void)m; (void)v; }}
Outcome model_outputs(Model *m, Report *r) {{
    (void)r;
    m->value[FORCE] = m->own.force;
    m->value[WORK] = m->own.work;
    m->value[PRESSURE_A] = m->value[PRESSURE_B] = 50e5;
    return OK;
}}
Outcome model_step(Model *m, double h, Report *r) {{
    double x = m->value[POSITION], v = m->value[VELOCITY];
    if (!m->own.started) {{ m->own.begin = x; m->own.started = 1; }}
    {step}
    double next = -2e6 * (x - m->own.begin) - 4e4 * v;
    m->own.work += {share} * h * 0.5 * (m->own.force + next) * v;
    m->own.force = next;
    return model_outputs(m, r);
}}
Outcome model_rates(Model *m, double x[], Report *r) {{ (void)m; (void)x; (void)r; return OK; }}
Outcome model_event(Model *m, double *next, Report *r) {{ (void)m; (void)next; (void)r; return OK; }}
"""
LATER = "if (m->time > 0.0495) "
MISCHIEF = {
    "good": "",
    "crash": LATER + "{ volatile int *p = NULL; *p = 1; }",
    "hang": LATER + "for (;;) sleep(1);",
    "nan": LATER + "{ m->own.force = 0.0 / 0.0; return model_outputs(m, r); }",
    "leak": LATER + "{ static char *volatile kept; kept = malloc(200000000); memset(kept, 1, 200000000); }",
    "lie": "",
}  # fmt: skip


def fake_cylinder(folder: Path, kind: str) -> Path:
    """A spring and a damper with the names of a cylinder. From 50 ms on it does its mischief."""
    source = folder / kind
    source.mkdir(parents=True)
    text = (CRANE / "robot.toml").read_text()
    names = sorted(set(re.findall(r"(\w+) = ", "".join(re.findall(r"parameters = \{(.*)\}", text)))))
    rows = "\n".join(f"{n} = {{ {'boolean = true, start = 1' if 'per_edge' in n else 'start = 1'} }}" for n in names)
    (source / "fmu.toml").write_text(TABLE.format(name=kind, parameters=rows))
    (source / "own.h").write_text(OWN)
    share = 1.5 if kind == "lie" else 1.0
    (source / f"{kind}.c").write_text(SOURCE.format(step=MISCHIEF[kind], share=share))
    return build_fmu(source, 2, out=folder / f"{kind}.fmu")


def crane(folder: Path, change=lambda text: text) -> Path:
    """A copy of hiab_xs031 whose robot.toml was changed."""
    folder.mkdir(exist_ok=True)
    (folder / "hiab_xs031.urdf").write_text((CRANE / "hiab_xs031.urdf").read_text())
    path = folder / "robot.toml"
    path.write_text(change((CRANE / "robot.toml").read_text()))
    return path


def driven_by(fmu: Path, lift: Path | None = None):
    """A change of robot.toml: this FMU in every cylinder, another one in the first."""
    names = 'inputs = { command = "command", position = "position", velocity = "velocity" }\n'
    names += 'outputs = { force = "force", work = "work", pressure_a = "pressure_a", pressure_b = "pressure_b" }'
    wired = lambda path: f'fmu = "{path}"\n{names}'  # noqa: E731
    first = lambda text: re.sub(r'fmu = "h.*"', wired(lift or fmu), text, count=1)  # noqa: E731
    return lambda text: re.sub(r'fmu = "h.*"', wired(fmu), first(text))


def skill(folder: Path) -> Path:
    """A skill file that pushes down and is not stopped by what a machine takes for a force in the air."""
    document = learned(registry().skill("lmc"), example_demonstrations())
    document["phases"][0]["stop"] |= {"force_limit_n": 1e5, "stall_s": 10.0}
    path = folder / "push.skill.json"
    save(document, path)
    return path
