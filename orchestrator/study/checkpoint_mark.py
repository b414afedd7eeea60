"""What a run is made of, item by item: a checkpoint is worth nothing to a run that is made of something else."""

import hashlib
import os
import platform
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.points.key import code_hash, component_content, library_versions

_KERNEL = "GFOR_COSIM_KERNEL"
_SHOWN = 4
"""So many differences are named."""


def mark_of(prepared: PreparedScenario) -> dict[str, str]:
    """Everything that the values of a run depend on, by name."""
    groups = " | ".join(", ".join(group) for group in prepared.schedule.groups)
    found = {
        "gfor-cosim": version("gfor-cosim"),
        **library_versions(),
        "the code of gfor-cosim": code_hash(),
        "machine": f"{sys.platform} {platform.machine()}",
        f"the environment variable {_KERNEL}": os.environ.get(_KERNEL, ""),
        "the text of the case": hashlib.sha256(prepared.case.text.encode()).hexdigest(),
        "the communication step": f"{prepared.step_size!r} s",
        "the stop time": f"{prepared.stop_time!r} s",
        "the schedule": f"{prepared.schedule.name}: {groups}",
        "the events": "; ".join(map(str, prepared.events)),
        "what is recorded": f"every {prepared.record_every} steps, "
        f"{'filtered' if prepared.record_filtered else 'as it is'}: {', '.join(prepared.record)}",
    }
    for name, plan in prepared.system.components.items():
        file, port = component_content(plan.description)
        found[f"the FMU of {name!r} ({_shown(plan.description.path)})"] = file
        found[f"the binding of {name!r}"] = port
        found[f"whether {name!r} runs in a process of its own"] = str(plan.isolated)
        found |= {f"the start value of {name}.{v}": repr(x) for v, x in plan.inputs.items()}
    found |= {f"the connection into {target}": str(plan) for target, plan in prepared.system.wires.items()}
    return found | {name: repr(value) for name, value in prepared.values.items()}


def _shown(path: Path) -> str:
    """A file by its name: the folder in which our own are cached says nothing to anybody."""
    return path.name


def differences(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What is not as it was, in words; empty where all is."""
    found = list(_differences(then, now))
    return "; ".join(found[:_SHOWN]) + (f"; and {len(found) - _SHOWN} more" if len(found) > _SHOWN else "")


def _differences(then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    for name in dict.fromkeys([*then, *now]):
        was, is_now = then.get(name), now.get(name)
        if was == is_now:
            continue
        if was is None or is_now is None:
            yield f"{name} {'is new' if was is None else 'is gone'}"
        elif max(len(was), len(is_now)) > 30:
            yield f"{name} has changed"
        else:
            yield f"{name} was {was or 'not there'} and is {is_now or 'not there'}"
