"""From an actuator's name mapping to value references: every name checked, wrong ones answered with the nearest."""

from __future__ import annotations

from collections.abc import Sequence

from skillframe.errors import InputError
from skillframe.fmu.actuator import INPUTS, OUTPUTS, ActuatorSpec
from skillframe.fmu.bindings import Instance
from skillframe.fmu.inspection import FLOATS, FmuFacts, FmuVariable
from skillframe.fmu.stepper import LARGEST, Wiring
from skillframe.fmu.values import values_of


def columns(specs: Sequence[ActuatorSpec]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the columns of `u` and `y`: the standard ones, then what a mapping adds."""
    more_in = [name for spec in specs for name in spec.inputs if name not in INPUTS]
    more_out = [name for spec in specs for name in spec.outputs if name not in OUTPUTS]
    return (*INPUTS, *dict.fromkeys(more_in)), (*OUTPUTS, *dict.fromkeys(more_out))


def mapping(spec: ActuatorSpec, facts: FmuFacts) -> tuple[dict[str, FmuVariable], dict[str, FmuVariable]]:
    """Variables of the FMU by our names, inputs and outputs.

    Raises:
        UnknownName: a mapped name that the FMU does not have.
        InputError: nothing that could be driven, no force, a variable that is no real scalar, or a parameter's value
            that is not of its type.
    """
    chosen_in = spec.inputs or {n: n for n in INPUTS if n in facts.names("input")}
    chosen_out = spec.outputs or {n: n for n in OUTPUTS if n in facts.names("output")}
    inputs = {ours: _scalar(facts, theirs, "input") for ours, theirs in chosen_in.items()}
    outputs = {ours: _scalar(facts, theirs, "output") for ours, theirs in chosen_out.items()}
    where = f"{spec.name or facts.name} ({facts.path.name})"
    if not inputs:
        known = ", ".join(facts.names("input")) or "none"
        raise InputError(where, f"no input is mapped (it has: {known})", 'add inputs = { command = "..." }')
    if "force" not in outputs:
        known = ", ".join(facts.names("output")) or "none"
        raise InputError(where, f"no output is mapped to force (it has: {known})", 'add outputs = { force = "..." }')
    for name in spec.parameters:
        values_of(facts.variable(name, "parameter"), spec.parameters[name], where)
    return inputs, outputs


def _scalar(facts: FmuFacts, name: str, causality: str) -> FmuVariable:
    variable = facts.variable(name, causality)
    if variable.type not in FLOATS or variable.size != 1:
        what = f"an array of {variable.size}" if variable.size != 1 else f"of type {variable.type}"
        raise InputError(
            f"{facts.path.name}: {name}", f"is {what}; a mapped variable is one real number", "map another"
        )
    return variable


def wire(instance: Instance, spec: ActuatorSpec, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Wiring:
    """The wiring of one instance.

    Raises:
        UnknownName, InputError: as `mapping`; more than 64 variables.
    """
    ins, outs = mapping(spec, instance.facts)
    if max(len(ins), len(outs)) > LARGEST:
        raise InputError(instance.name, f"more than {LARGEST} variables are mapped", "map fewer")
    return Wiring(
        instance,
        [v.reference for v in ins.values()], [inputs.index(name) for name in ins],
        [v.reference for v in outs.values()], [outputs.index(name) for name in outs],
    )  # fmt: skip
