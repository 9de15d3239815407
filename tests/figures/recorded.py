"""The real recordings at hand, read as `docs/how-to/real-recording.md` reads them, for tables over all of them."""

from __future__ import annotations

from pathlib import Path

from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration
from tests.references import recordings_dir

POSE, WRENCH = "px,py,pz,qx,qy,qz,qw", "fx,fy,fz,tx,ty,tz"


def recordings() -> dict[str, Demonstration]:
    """Every recording with a pose and a wrench, by name: three snap assemblies, three wipes, two arms."""
    base = recordings_dir()
    if base is None:
        return {}
    found = {f"snap {trial}": snap(base / "hiro_snap_assembly" / trial) for trial in ("02", "10", "22")}
    for i in range(3):
        found[f"wipe {i}"] = read_demonstration(
            base / "icsc_wiping" / f"rim{i}.csv", columns="t,px,py,pz,qw,qx,qy,qz,fx,fy,fz,tx,ty,tz"
        )
    for arm in ("active", "passive"):
        found[f"peel {arm}"] = read_demonstration(
            base / "icsc_peeling" / "recording2.csv", columns=peeling(arm), rate=100.0
        )
    return found


def snap(folder: Path) -> Demonstration:
    """One trial of the snap assembly."""
    return read_demonstration(
        folder / "R_CartPos.dat", columns="t,px,py,pz,roll,pitch,yaw", euler="xyz",
        wrench=folder / "worldforce.dat", wrench_columns="t,fx,fy,fz,tx,ty,tz",
    )  # fmt: skip


def peeling(arm: str) -> str:
    """Columns of one arm."""
    names = {"px": "x", "py": "y", "pz": "z", **{n: n for n in ("qx", "qy", "qz", "qw", *WRENCH.split(","))}}
    return ",".join(f"{name}={arm}_{column}" for name, column in names.items())


def every_recording() -> dict[str, Demonstration]:
    """Those of `recordings`, and an arm's motion without contact, its sensor calibrated by nothing."""
    found, base = recordings(), recordings_dir()
    if base is not None:
        place = base / "kuka_ati"
        found["kuka motion"] = read_demonstration(
            place / "1-baseline_orientations.csv", wrench=place / "1-baseline_wrench.csv", units="us",
            position="0,0,0", wrench_frame="tool", wrench_includes_tool_weight=True, zero_time=True,
        )  # fmt: skip
    return found
