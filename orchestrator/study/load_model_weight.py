"""How much an open load model moves the least damped mode, where that is cheap to say."""

from typing import Protocol, Self

from orchestrator.analysis.modes import Mode
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.errors import CosimError
from orchestrator.study.modes import ModesResult, compute_modes

_MOST_STATES = 200
"""Of a system whose modes are computed a second time."""


class Choosable(Protocol):
    """A scenario that can be prepared with loads of constant power."""

    @property
    def prepared(self) -> PreparedScenario:
        """As it was asked for."""

    def with_loads_as_powers(self) -> Self | None:
        """The other one; None where the load model is not open."""


def load_model_weight(scenario: Choosable, result: ModesResult) -> str | None:
    """The least damped mode with both load models; None where the model is not open, or the system is large."""
    if result.model.number_of_states > _MOST_STATES:
        return None
    try:
        other = scenario.with_loads_as_powers()
        found = None if other is None else compute_modes(other.prepared)
    except CosimError as error:
        return f"the load model: with constant powers there are no modes: {str(error).splitlines()[0]}"
    here, there = _least_damped(result), None if found is None else _least_damped(found)
    if here is None or there is None:
        return None
    return (
        f"the load model moves the least damped mode: impedance {_figures(here)}, power {_figures(there)}; write which "
        "in [network], as load_model"
    )


def _least_damped(result: ModesResult) -> Mode | None:
    swings = [mode for mode in result.modes if mode.is_oscillation]
    return min(swings, key=lambda mode: mode.damping_percent, default=None)


def _figures(mode: Mode) -> str:
    return f"{mode.damping_percent:.2f} % at {mode.frequency_hz:.3f} Hz"
