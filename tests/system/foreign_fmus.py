"""FMUs of other makers, FMI 2 and 3.

What pythonfmu and pythonfmu3 build from models that they ship and from ours; containers of FMU Manipulation Toolbox,
a compiled master of its own around one of our cylinders.
"""

import json
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

WINCH = '''
from {package} import {slave}, {enum}Causality, {enum}Variability, {real}


class Winch({slave}):
    """Rope force that follows a command with a lag of 0.1 s and falls with speed."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.x = self.v = self.F = self.lag = self.time = 0.0
        self.stall = 2000.0
        {time}
        self.register_variable({real}("u", causality={enum}Causality.input))
        self.register_variable({real}("v", causality={enum}Causality.input))
        self.register_variable({real}("stall", causality={enum}Causality.parameter, variability={enum}Variability.tunable))
        self.register_variable({real}("F", causality={enum}Causality.output))

    def do_step(self, current_time, step_size):
        self.lag += step_size * (self.u - self.lag) / 0.1
        self.F = self.stall * self.lag - 500.0 * self.v
        return True
'''  # noqa: E501
WORDS = {
    2: {"package": "pythonfmu", "slave": "Fmi2Slave", "enum": "Fmi2", "real": "Real", "time": ""},
    3: {
        "package": "pythonfmu3", "slave": "Fmi3Slave", "enum": "Fmi3", "real": "Float64",
        "time": 'self.register_variable(Float64("time", causality=Fmi3Causality.independent,'
        " variability=Fmi3Variability.continuous))",
    },
}  # fmt: skip
# one run in a process of its own: an FMU that embeds Python must not share it with the tests
FMPY = """
import json, sys
import numpy as np
from fmpy import simulate_fmu
path, start, table, stop, step = json.loads(sys.argv[1])
signals = np.array([tuple(r) for r in table[1]], dtype=[(n, float) for n in table[0]]) if table else None
r = simulate_fmu(path, validate=False, start_time=0.0, stop_time=stop, step_size=step, output_interval=step,
                 fmi_type="CoSimulation", start_values=start, input=signals)
print("result " + json.dumps({n: np.asarray(r[n]).tolist() for n in r.dtype.names}))
"""


def shipped(version, name, folder: Path) -> Path:
    """A model out of the maker's own wheel, built by the maker's own tool with the maker's own binary."""
    models = Path(import_module(WORDS[version]["package"]).__file__).parent / "tests" / "slaves"
    return _build(version, models / f"{name}.py", folder, [models / "localmodule.py"] if "dep" in name else [])


def winch(version, folder: Path) -> Path:
    """An actuator of our own in the maker's frame."""
    folder.mkdir(parents=True, exist_ok=True)
    source = folder / f"winch{version}.py"
    source.write_text(WINCH.format(**WORDS[version]))
    return _build(version, source, folder, [])


def _build(version, source, folder, files):
    folder.mkdir(parents=True, exist_ok=True)
    builder = import_module(WORDS[version]["package"] + ".builder").FmuBuilder
    return Path(builder.build_FMU(source, dest=folder, project_files=files))


def by_fmpy(path, start=None, table=None, stop=0.1, step=0.01):
    """Columns of fmpy's own simulate_fmu, or the last line of what it raised."""
    request = json.dumps([str(path), start or {}, table, stop, step])
    done = subprocess.run([sys.executable, "-c", FMPY, request], capture_output=True, text=True, timeout=120)
    found = [line for line in done.stdout.splitlines() if line.startswith("result ")]
    return json.loads(found[0][7:]) if found else done.stderr.strip().splitlines()[-1]


CONTAINER = """rule;from_fmu;from_port;to_fmu;to_port
FMU;cylinder.fmu;;;
INPUT;;u;cylinder.fmu;command
INPUT;;x;cylinder.fmu;position
INPUT;;v;cylinder.fmu;velocity
INPUT;;a;cylinder.fmu;acceleration
OUTPUT;cylinder.fmu;force;;F
OUTPUT;cylinder.fmu;work;;W
OUTPUT;cylinder.fmu;pressure_a;;pa
OUTPUT;cylinder.fmu;pressure_b;;pb
"""


def container(version, cylinder: Path, folder: Path, parameters: bool = False) -> Path:
    """An FMU around a cylinder's, made by the toolbox with its own compiled master. Parameters as cylinder.NAME."""
    shutil.copy(cylinder, folder / "cylinder.fmu")
    (folder / "held.csv").write_text(CONTAINER)
    code = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    options = ["-fmu-directory", folder, "-container", "held.csv:0.001", "-fmi", version, "-no-auto-output"]
    options += ["-auto-parameter"] * parameters
    subprocess.run([sys.executable, "-c", code, *map(str, options)], check=True, capture_output=True, timeout=60)
    return folder / "held.fmu"
