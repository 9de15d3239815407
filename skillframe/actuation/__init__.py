"""Actuators: functional mock-up units (FMI 2 and 3) driven in the loop, and their Python reference.

The way of an FMU: a name in `fmus/` is built once (`library`, `build`, `toolchain`), any file is inspected
(`inspect`), unpacked safely once (`extract`), loaded once and driven by cached low-level calls (`bindings`, `driver`),
or, if nobody has allowed it, by a child process with limits (`sandbox`, `worker`). `actuator` chooses.
"""
