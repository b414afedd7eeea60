"""Linear models that are kept: a component whose whole state is the same to the last bit has the same one."""

from collections.abc import Callable, Hashable
from typing import TypeVar

from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.devices.fmi.port_mapping import without_binding
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.systems.coupling.master import Master

Made = TypeVar("Made")

_KEPT = 500  # linear models that are kept at once


def remembered(
    master: Master,
    name: str,
    asked: tuple[Hashable, ...],
    linearized: Callable[[], ComponentLinearization],
) -> ComponentLinearization:
    """A component's linear model: what is kept of the same FMU, in the same state, asked for in the same way.

    The state is the FMU's own, as bytes: parameters, inputs and states. Only FMUs of this toolchain are trusted to put
    all of it there."""
    store, component, exchange = master.remembered, master.components[name], master.exchanges[name]
    description = component.description
    if store is None or not description.can_serialize_state:
        return linearized()
    if len(store) >= _KEPT:
        store.clear()
    if not is_ours_in(master, name):
        return linearized()
    names = (exchange.inputs.names, exchange.outputs.names)
    of = (description.path, description.guid, description.states)
    key = (name, *of, names, asked, master.time, _state(component))
    if key not in store:
        store[key] = linearized()
    found: ComponentLinearization = store[key]
    return found


def is_ours_in(master: Master, name: str) -> bool:
    """Return whether this machine's own toolchain built a running component's FMU, behind a binding or not."""
    component = master.components[name]
    path = without_binding(component.description).path
    return keep_by_system(master, "ours", (component,), lambda: is_ours(path))


def keep_by_system(
    master: Master | None, kind: Hashable, of: tuple[object, ...], make: Callable[[], Made]
) -> Made:
    """Return what was made of these very objects, where the system keeps linear models."""
    store = None if master is None else master.remembered
    if store is None:
        return make()
    key = (kind, *map(id, of))
    if key not in store:
        store[key] = of, make()  # the objects as well, so that no other gets their identity
    found: Made = store[key][1]
    return found


def _state(component: Component) -> bytes:
    saved = component.save_state()
    try:
        return component.serialize_state(saved)
    finally:
        component.free_state(saved)
