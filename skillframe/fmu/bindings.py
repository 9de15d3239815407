"""One FMU instance, created, initialised and freed by fmpy. The loop calls its functions by address."""

from __future__ import annotations

import ctypes
import itertools
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any
from weakref import WeakValueDictionary

from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import DISCARD
from skillframe.fmu.extract import unpack
from skillframe.fmu.facts import FmuFacts, values_of

_KEYS = itertools.count(1)
_LISTENERS: WeakValueDictionary[int, Instance] = WeakValueDictionary()


def _hear2(key: int | None, name: bytes, status: int, category: bytes, text: bytes | None) -> None:
    """Dispatch FMI 2 messages by key: fmpy's formatting proxy has only one logger."""
    instance = _LISTENERS.get(key or 0)
    if instance is not None:
        instance._hear(text)


@lru_cache(maxsize=1)
def _logger2() -> Any:
    from fmpy import fmi2

    return fmi2.fmi2CallbackLoggerTYPE(_hear2)


def _callbacks2(key: int) -> Any:
    from fmpy import calloc, fmi2, free

    calls = fmi2.fmi2CallbackFunctions()
    calls.logger = _logger2()
    calls.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    calls.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    calls.componentEnvironment = key
    with suppress(ImportError, OSError):
        from fmpy.logging import addLoggerProxy

        addLoggerProxy(ctypes.byref(calls))
    return calls


NOT_LOADED = "does not load"


class InstanceFailed(SkillframeError):
    """An FMU refused a call outside the loop, with its message."""


class Instance:
    """A co-simulation instance.

    Attributes:
        version: 2 or 3; component: its handle; messages: the last ones, newest last.
    """

    def __init__(self, facts: FmuFacts, name: str) -> None:
        """Load the library and instantiate.

        Raises:
            InputError: not runnable here.
            InstanceFailed: it does not load or instantiate.
        """
        facts.require_runnable()
        self.facts, self.name = facts, name
        self.version = int(facts.fmi_version[0])
        self.messages: deque[str] = deque(maxlen=8)
        self._states: dict[str, ctypes.c_void_p] = {}
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        try:
            self._fmu: Any = (FMU2Slave if self.version == 2 else FMU3Slave)(
                guid=self.facts.token, unzipDirectory=str(unpack(self.facts.path)),
                modelIdentifier=self.facts.identifier, instanceName=self.name,
            )  # fmt: skip
            if self.version == 3:
                self._fmu.instantiate(logMessage=lambda env, status, category, text: self._hear(text))
            else:
                key = next(_KEYS)
                _LISTENERS[key] = self
                self._fmu.instantiate(callbacks=_callbacks2(key))
        except Exception as error:
            tool = "; its maker's tool must be installed" if self.facts.needs_tool else ""
            raise InstanceFailed(self.sentence(f"{NOT_LOADED}: {error}") + tool) from None
        self.component = int(getattr(self._fmu.component, "value", self._fmu.component))
        self._fresh = True

    def _hear(self, text: bytes | None) -> None:
        self.messages.append(" ".join((text or b"").decode("utf-8", "replace").split())[:300])

    def sentence(self, problem: str) -> str:
        """A problem with the FMU's last message."""
        said = f" ({self.messages[-1]})" if self.messages and self.messages[-1] not in problem else ""
        return f"{self.name} ({self.facts.path.name}): {problem}{said}"

    def address(self, name2: str, name3: str) -> int:
        """Address of a library function, by its name in either version."""
        function = getattr(self._fmu.dll, name2 if self.version == 2 else name3)
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    def start(self, parameters: Mapping[str, Any], inputs: Mapping[int, float], time: float) -> None:
        """Reset if necessary, set parameters, inputs by value reference and time [s], and initialise.

        Raises:
            UnknownName: no such parameter.
            InstanceFailed: the FMU refuses.
        """
        self.messages.clear()
        try:
            if not self._fresh:
                self._fmu.reset()
            self._fresh = False
            for name, value in parameters.items():
                self.set_value(name, value)
            if self.version == 2:
                self._fmu.setupExperiment(startTime=time)
                self._fmu.enterInitializationMode()
            else:
                self._fmu.enterInitializationMode(startTime=time)
            if inputs:
                setter = self._fmu.setReal if self.version == 2 else self._fmu.setFloat64
                setter(list(inputs), list(inputs.values()))
            self._fmu.exitInitializationMode()
        except SkillframeError:
            raise
        except Exception as error:
            raise InstanceFailed(self.sentence(f"cannot be initialised: {error}")) from None

    def set_value(self, name: str, value: Any) -> None:
        """Set a parameter or input before initialisation, converted to its type.

        Raises:
            UnknownName, InputError: no such parameter, or a value of the wrong type.
        """
        variable = self.facts.settable(name)
        converted = values_of(variable, value, self.name)
        typed = variable.type if variable.type != "Enumeration" else ("Integer" if self.version == 2 else "Int64")
        getattr(self._fmu, f"set{typed}")([variable.reference], converted)

    def set_values(self, type_: str, references: list[int], values: list[Any]) -> None:
        """Set variables of one type by reference."""
        getattr(self._fmu, f"set{type_}")(references, values)

    def do_step(self, time: float, step: float) -> float | None:
        """Do a step outside the loop. Returns the time at which the FMU ends the run, or None.

        Raises:
            InstanceFailed: it returned early without permission.
            Exception: fmpy's, with the status.
        """
        try:
            flags = self._fmu.doStep(time, step)
        except Exception as error:
            if self.version == 2 and getattr(error, "status", 0) == DISCARD and self._terminated():
                return float(self._fmu.getRealStatus(2))  # fmi2LastSuccessfulTime
            raise
        if self.version == 2:
            return None
        if flags[2] and not flags[1]:
            raise InstanceFailed("returned early from a step, which was not allowed")
        return float(flags[3]) if flags[1] else None

    def _terminated(self) -> bool:
        try:
            return bool(self._fmu.getBooleanStatus(3))  # fmi2Terminated
        except Exception:
            return False

    def get_values(self, type_: str, references: list[int], count: int) -> list[Any]:
        """Values of variables of one type, arrays flattened."""
        typed = type_ if type_ != "Enumeration" else ("Integer" if self.version == 2 else "Int64")
        getter = getattr(self._fmu, f"get{typed}")
        return list(getter(references) if self.version == 2 else getter(references, nValues=count))

    def save(self, slot: str = "main") -> None:
        """Save the state under a name, reusing its memory."""
        name = "fmi2GetFMUstate" if self.version == 2 else "fmi3GetFMUState"
        getattr(self._fmu, name)(self._fmu.component, ctypes.byref(self._states.setdefault(slot, ctypes.c_void_p())))

    def restore(self, slot: str = "main") -> None:
        """Restore a saved state."""
        name = "fmi2SetFMUstate" if self.version == 2 else "fmi3SetFMUState"
        getattr(self._fmu, name)(self._fmu.component, self._states[slot])

    def forget(self) -> None:
        """Free saved states, ignoring failures."""
        name = "fmi2FreeFMUstate" if self.version == 2 else "fmi3FreeFMUState"
        for state in self._states.values():
            with suppress(Exception):
                getattr(self._fmu, name)(self._fmu.component, ctypes.byref(state))
        self._states.clear()

    def end(self) -> None:
        """Terminate the run, as required before `close`.

        Raises:
            InstanceFailed: the FMU refuses.
        """
        try:
            self._fmu.terminate()
        except Exception as error:
            raise InstanceFailed(self.sentence(f"cannot be terminated: {error}")) from None

    def close(self) -> None:
        """Free the instance."""
        self.forget()
        self._fmu.freeInstance()
