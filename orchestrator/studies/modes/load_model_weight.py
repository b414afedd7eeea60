"""How much an open load model moves the least damped mode, where that is cheap to say."""

import math
from collections.abc import Sequence
from typing import Protocol, Self

from orchestrator.cases.networks.load_models import is_open
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.modes.modes import ModesResult, compute_modes

_MOST_STATES = 200  # of a system whose modes are computed a second time


class Choosable(Protocol):
    @property
    def prepared(self) -> PreparedScenario:
        """The scenario as it was asked for."""

    def with_loads_as_powers(self) -> Self | None:
        """The other one; None where the load model is not open."""


def load_model_weights(
    scenarios: Sequence[Choosable],
    results: Sequence[ModesResult],
    frequency_range: tuple[float, float],
) -> list[str]:
    """The least damped mode of the range with both load models, of the scenario where the lower one is least."""
    weights = [_weight(*each, frequency_range) for each in zip(scenarios, results, strict=True)]
    known = [
        (least, text, r.prepared.name)
        for r, (least, text) in zip(results, weights, strict=True)
        if text
    ]
    if not known:
        return []
    _, text, name = min(known, key=lambda one: one[0])
    alike = len({text for _, text, _ in known}) == 1
    return [text if alike else f"scenario {name!r}, the least damped of {len(known)}: {text}"]


def _weight(
    scenario: Choosable, result: ModesResult, frequency_range: tuple[float, float]
) -> tuple[float, str]:
    """The least damping [%] with either load model, and the question; "" where there is none to ask."""
    network = result.prepared.case.table.network
    prepared = result.prepared
    loads = prepared.network.loads if prepared.network else ()
    told = prepared.recorded_loads | prepared.told_loads
    if not is_open(network) or not {load.name for load in loads} - told:
        return 0.0, ""
    states = result.model.number_of_states
    if states > _MOST_STATES:
        return -math.inf, (
            f"the load model is open, and how much it moves the modes was not computed, as the system has {states} "
            f"states, more than {_MOST_STATES}; write which in [network], as load_model, once as each, and compare"
        )
    try:
        other = scenario.with_loads_as_powers()
        found = None if other is None else compute_modes(other.prepared, frequency_range)
    except CosimError as error:
        text = (
            f"the load model: with constant powers there are no modes: {str(error).splitlines()[0]}"
        )
        return -math.inf, text
    here, there = _least_damped(result), None if found is None else _least_damped(found)
    if here is None or there is None:
        return 0.0, ""
    return min(here.damping_percent, there.damping_percent), _in_words(here, there, frequency_range)


def _in_words(as_impedance: Mode, as_power: Mode, frequency_range: tuple[float, float]) -> str:
    """The question, which says so where one load model makes the mode grow and the other one does not."""
    low, high = frequency_range
    turns = _grows(as_impedance) != _grows(as_power)
    impedance, power = (
        _figures(mode) + (", unstable" if turns and _grows(mode) else "")
        for mode in (as_impedance, as_power)
    )
    return (
        f"the load model moves the least damped mode from {low:g} to {high:g} Hz: impedance {impedance}, power "
        f"{power}; write which in [network], as load_model"
    )


def _grows(mode: Mode) -> bool:
    return mode.damping_percent < 0


def _least_damped(result: ModesResult) -> Mode | None:
    swings = [mode for mode in result.modes if mode.is_oscillation]
    return min(swings, key=lambda mode: mode.damping_percent, default=None)


def _figures(mode: Mode) -> str:
    return f"{mode.damping_percent:.2f} % at {mode.frequency_hz:.3f} Hz"
