"""A device at events, beside which causes of its errors are tried."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.causes import CauseKind, Explanation, leaves_much
from orchestrator.studies.validation.device import Play, PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent, noise_before
from orchestrator.studies.validation.hidden import HiddenPart, hidden_voltages, with_hidden
from orchestrator.studies.validation.parameters import NEVER
from orchestrator.studies.validation.residuals import LEAST_SCATTER, Report

_MOST_WORDS = 8  # positions of a whole number that are tried

Values = Mapping[str, float | bool]
Responses = Sequence[Complex]


@dataclass
class CauseBench:
    """A device at events, with what was found of it so far.

    ``squares`` of an error: the mean over the events of the squares of the rms errors of P and Q [pu²].
    ``hidden``: how the voltage between samples moves the errors; that of another bench at the same events will do."""

    device: PlayedDevice
    events: Sequence[RecordedEvent]
    report: Report
    hidden: HiddenPart | None = None
    base: Responses = field(init=False)
    error: Numbers = field(init=False)
    noise: float = field(init=False)
    idle: list[VariableInfo] = field(default_factory=list)  # numbers that act on nothing

    def __post_init__(self) -> None:
        played = [self.device.play(one.recording, one.start) for one in self.events]
        self.base = [one.power for one in played]
        pairs = zip(self.events, played, strict=True)
        scatters = [noise_before(event, one) for event, one in pairs]
        self.noise = float(np.mean([n[s].scatter ** 2 for n in scatters for s in "pq"]) * 2) ** 0.5
        if self.hidden is None:
            self.hidden = self._hidden_part()
        self.error = self.errors(self.base)

    @property
    def misses(self) -> bool:
        """Return whether the device itself leaves more than a right one would."""
        return leaves_much(float(np.sqrt(squares_of(self.error))), self.noise)

    def _hidden_part(self) -> HiddenPart:
        """How the errors move with the voltage that no sample holds, one run for each unknown."""
        unknown = hidden_voltages(self.events)
        plays = []
        for one in unknown:
            event = self.events[one.event]
            moved = with_hidden(event.recording, [one], {one.name: one.scale})
            plays.append(Play(self.device, moved, event.start))
        self.device.announce(plays)
        columns = []
        for one, play in zip(unknown, plays, strict=True):
            self.report("looking between the samples")
            responses = list(self.base)
            responses[one.event] = self.device.play(play.recording, play.start).power
            columns.append((self._plain(responses) - self._plain(self.base)) / one.scale)
        size = np.sqrt(sum(int(one.recording.good.sum()) for one in self.events))
        scatter = max(self.noise / np.sqrt(2), LEAST_SCATTER) / size
        return HiddenPart.of(columns, [one.scale for one in unknown], float(scatter))

    def parameters(self, kind: str) -> Iterator[VariableInfo]:
        for info in self.device.description.variables.values():
            if info.causality == "parameter" and info.type == kind and info.name not in NEVER:
                yield info

    def is_kind(self, name: str) -> bool:
        """Return whether a parameter is a position and no number."""
        return self.device.description.variables[name].type != "Real"

    def announce(self, each: Iterable[Values]) -> None:
        """Tell with which values responses will be asked for, one after the other: they may be made side by side."""
        devices = [self.device.with_values(values) for values in each]
        plays = [
            Play(device, one.recording, one.start) for device in devices for one in self.events
        ]
        self.device.announce(plays)

    def responses(self, values: Values) -> Responses | None:
        """The device's answers with other values; None where it does not run with them."""
        device = self.device.with_values(values)
        found: Responses | None = None
        tried = ", ".join(f"{name} = {_plainly(value)}" for name, value in values.items())
        with device.trials.trial(tried):
            found = [device.play(one.recording, one.start).power for one in self.events]
        return found

    def errors(self, responses: Responses) -> Numbers:
        """All errors of P and Q, of which the squares add up; those before the event count a start that is off.

        Without the part that the voltage between samples makes, as far as that is likely."""
        plain = self._plain(responses)
        return plain if self.hidden is None else self.hidden.taken_out_of(plain)

    def _plain(self, responses: Responses) -> Numbers:
        parts = []
        for event, power in zip(self.events, responses, strict=True):
            recording = event.recording
            error = (power - recording.power)[recording.good]
            size = np.sqrt(len(error) * len(self.events))
            parts += [error.real / size, error.imag / size]
        return np.concatenate(parts)

    def noise_alone(self) -> Explanation:
        """The recordings' own noise as the cause of the error, which it is where that is hardly larger."""
        left = np.array([self.noise])
        return self.explanation(CauseKind.NOISE, "the recordings' own noise", None, 0.0, left)

    def explanation(
        self,
        cause: CauseKind,
        name: str,
        now: float | bool | None,
        value: float | bool,
        left: Numbers,
        *,
        unit: str = "",
    ) -> Explanation:
        rms = [float(np.sqrt(one @ one)) for one in (self.error, left)]
        return Explanation(
            cause, name, unit, now, value, error=rms[0], left=rms[1], noise=self.noise
        )


def other_positions(bench: CauseBench) -> Iterator[tuple[VariableInfo, float | bool]]:
    """Other positions of switches, and of kinds, which are whole numbers within bounds."""
    for info in bench.parameters("Boolean"):
        yield info, not bench.device.value(info.name)
    for info in bench.parameters("Integer"):
        low, high = info.minimum, info.maximum
        if low is None or high is None or high - low >= _MOST_WORDS:
            continue
        for value in range(int(low), int(high) + 1):
            if value != bench.device.value(info.name):
                yield info, value


def squares_of(error: Numbers) -> float:
    """The sum of an error's squares."""
    return float(error @ error)


def _plainly(value: float | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}"
