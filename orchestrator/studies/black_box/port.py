"""The values and the port of an FMU that is to be measured."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.cases.form.values import check_system_base, convert
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.device_or_controller import NO_BUS, is_controller_alone
from orchestrator.studies.black_box.bench import Bench


def values_for(description: FmuDescription, given: Mapping[str, Any]) -> dict[str, float | bool]:
    values = {}
    for name, value in given.items():
        info = description.variables.get(name)
        if info is None:
            raise InputError(
                Option.SET
                + f" {name}: {description.path.name} has no such variable; `gfor fmu info` "
                "lists them"
            )
        try:
            values[name] = convert(info, value)
            check_system_base(description, name, values[name])
        except ValueError as error:
            raise InputError(Option.SET + f" {name}: {error}") from error
    return values


def start_of(description: FmuDescription, name: str) -> float:
    info = description.variables.get(name)
    return (
        info.start_number if info is not None and info.start is not None else float(name == "v_0")
    )


def bench_at(
    description: FmuDescription, given: Mapping[str, Any], step: float, restore: bool | None = None
) -> Bench:
    """A device at an ideal bus of its own start. Refuses an FMU without the voltages and currents of our port."""
    values = values_for(description, given)
    v, angle = (float(values.get(name, start_of(description, name))) for name in ("v_0", "theta_0"))
    at = v * np.array([math.cos(angle), math.sin(angle)])
    bench = Bench(description, values, at, step_size=step, restore=restore)
    missing = [n for n in (*bench.inputs, *bench.outputs) if n not in description.variables]
    if missing and is_controller_alone(description):
        raise InputError(f"{description.path.name}: it has no {', '.join(missing)}: {NO_BUS}")
    if missing:
        raise InputError(
            f"{description.path.name}: it has no {', '.join(missing)}; an admittance is "
            "measured at our port, to which a vendor.toml maps another FMU's variables; "
            "give it with " + Option.BINDING
        )
    return bench
