"""States that nothing moves: clocks, which say nothing of a system, and what should not be taken for one."""

from orchestrator.core.errors import few
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.systems.coupling.master import Master

_SHOWN = 3
_TURN_BY_THEMSELVES = ("s", "rad")  # units of clocks, and of the angles of stiff sources


def standing_apart(master: Master, model: LinearModel, zeros: int) -> list[str]:
    """A sentence on states that nothing moves, where their zeros would not pass for the free angle.

    Their zeros are not counted among those that nothing restores: what nothing moves does not drift. An integrator of a
    controller that is off looks just like that, so that whoever believes it on must be told. A state in seconds is a
    clock, and one in radians the angle of a source that turns by itself."""
    if zeros + len(model.unmoved) <= 1:
        return []
    names = [name for name in model.unmoved if _unit(master, name) not in _TURN_BY_THEMSELVES]
    if not names:
        return []
    text = (
        f"states that nothing moves, as of a controller that is off or rests within a dead band: "
        f"{few(names, _SHOWN)}"
    )
    return [f"{text}; their zeros are not counted"]


def _unit(master: Master, name: str) -> str:
    """The unit that an FMU gives a state ``component.state``; "" where it gives none."""
    component, _, state = name.partition(".")
    found = master.components.get(component)
    variable = None if found is None else found.description.variables.get(state)
    return "" if variable is None else variable.unit or ""
