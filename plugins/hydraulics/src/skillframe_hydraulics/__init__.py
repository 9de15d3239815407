"""The hydraulic machine: cylinders, controller, force estimate, and checks.

This module registers them and is all that is imported when plug-ins are listed.
"""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import DriveType, Lazy, LazyCommand

skillframe_contract = "0.2"

export_command = LazyCommand("Write a machine as a system of FMUs (SSP).", "skillframe_hydraulics.export:command")


@hookimpl
def skillframe_drives() -> Iterable[DriveType]:
    """The drive of hydraulic machines."""
    here = "skillframe_hydraulics"
    yield DriveType(
        name="hydraulic", summary="hydraulic cylinders", example="hiab_xs031", actuated=True,
        law="force and motion of cylinders",
        sensors="encoders and chamber pressures", make=Lazy(f"{here}.entry:make"), check=Lazy(f"{here}.entry:check"),
        audit=Lazy(f"{here}.checks.audit:machine_warnings"), derived=Lazy(f"{here}.entry:derived"),
        told=Lazy(f"{here}.entry:told"), tables=Lazy(f"{here}.declared:tables"),
        write_out=Lazy(f"{here}.described:write_out"), quantities=Lazy(f"{here}.quantities:quantities"),
        lacks=Lazy(f"{here}.quantities:lacks"),
        noise=Lazy(f"{here}.declared:noise_of"), teach=Lazy(f"{here}.sessions:record_operated"),
        teacher=Lazy(f"{here}.teleoperation:OperatorSettings"), aimed=Lazy(f"{here}.sessions:aimed"),
        plots=Lazy(f"{here}.plots:machine_plots"),
    )  # fmt: skip
