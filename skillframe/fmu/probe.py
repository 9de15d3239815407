"""Try out what an FMU claims: save, step, restore, step must repeat. Outputs may follow inputs without a step."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from skillframe.fmu.actuator import ActuatorSpec, Capabilities
from skillframe.fmu.bindings import Instance, InstanceFailed
from skillframe.fmu.inspection import FLOATS, FmuFacts, FmuVariable, inspect_fmu
from skillframe.fmu.wiring import mapping

STEP = 1e-3  # s, the communication step of the probe


def probe(facts: FmuFacts, spec: ActuatorSpec) -> Capabilities:
    """Capabilities of an FMU under a mapping. Two short instances are made and freed.

    Raises:
        InstanceFailed: it cannot be started at all.
    """
    inputs, outputs = mapping(spec, facts)
    values = tuple(sorted((k, v) for k, v in spec.parameters.items() if isinstance(v, float | int | str)))
    rollback, refresh = _tried(facts.path, facts.digest, tuple(sorted(_refs(inputs))), tuple(_refs(outputs)), values)
    return Capabilities(
        acceleration="acceleration" in inputs, force_mean="force_mean" in outputs, work="work" in outputs,
        rollback=rollback, variable_step=facts.variable_step, refresh=refresh,
    )  # fmt: skip


def try_out(facts: FmuFacts) -> bool:
    """Ten steps with inputs at their start values. Returns whether a saved state repeats (False if none can be saved).

    Raises:
        InstanceFailed: it does not start or step.
    """
    outputs = tuple((v.name, v.reference) for v in facts.variables.values() if v.causality == "output" and _real(v))
    instance = Instance(facts, facts.name)
    try:
        instance.start({}, {}, 0.0)
        repeats = facts.saves_state and _repeats(instance, outputs)
        for k in range(10):
            try:
                _advance(instance, k * STEP)
            except Exception as error:
                raise InstanceFailed(instance.sentence(f"failed at {k * STEP:g} s: {error}")) from None
        for (name, _), value in zip(outputs, _read(instance, outputs) if outputs else [], strict=True):
            if value - value != 0.0:
                raise InstanceFailed(instance.sentence(f"output {name} is {value} after {10 * STEP:g} s"))
        return repeats
    finally:
        instance.close()


def _real(variable: FmuVariable) -> bool:
    return variable.type in FLOATS and variable.size == 1


def _refs(variables: dict[str, FmuVariable]) -> list[tuple[str, int]]:
    return [(name, v.reference) for name, v in variables.items()]


@lru_cache(maxsize=64)
def _tried(
    path: Path, digest: str, inputs: tuple[tuple[str, int], ...], outputs: tuple[tuple[str, int], ...],
    parameters: tuple[tuple[str, object], ...],
) -> tuple[bool, bool]:  # fmt: skip
    facts = inspect_fmu(path)
    instance = Instance(facts, facts.name)
    try:
        start = {reference: _start(facts, reference) for _, reference in inputs}
        instance.start(dict(parameters), start, 0.0)
        return _repeats(instance, outputs) if facts.saves_state else False, _follows(instance, dict(inputs), outputs)
    finally:
        instance.close()


def _start(facts: FmuFacts, reference: int) -> float:
    found = next(v for v in facts.variables.values() if v.reference == reference and v.causality == "input")
    return float(found.start or 0.0)


def _read(instance: Instance, outputs: tuple[tuple[str, int], ...]) -> list[float]:
    references = [reference for _, reference in outputs]
    return instance.get_values("Real" if instance.version == 2 else "Float64", references, len(references))


def _advance(instance: Instance, time: float) -> None:
    instance.do_step(time, STEP)


def _repeats(instance: Instance, outputs: tuple[tuple[str, int], ...]) -> bool:
    """Two steps from a saved state, twice: identical to the bit?"""
    try:
        instance.save()
        results = []
        for _ in range(2):
            _advance(instance, 0.0)
            _advance(instance, STEP)
            results.append(_read(instance, outputs))
            instance.restore()
        return results[0] == results[1]
    except Exception:
        return False


def _follows(instance: Instance, inputs: dict[str, int], outputs: tuple[tuple[str, int], ...]) -> bool:
    """Does an output answer to a new position or velocity before the next step?"""
    moved = [reference for name, reference in inputs.items() if name in ("position", "velocity")]
    if not moved:
        return False
    try:
        before = _read(instance, outputs)
        real = "Real" if instance.version == 2 else "Float64"
        shifted = [1e-3 + v for v in instance.get_values(real, moved, len(moved))]
        instance.set_values(real, moved, shifted)
        return before != _read(instance, outputs)
    except Exception:
        raise InstanceFailed(instance.sentence("fails when outputs are read between steps")) from None
