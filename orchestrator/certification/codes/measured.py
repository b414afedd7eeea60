"""Signals of one row, and what criteria read from them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.certification.point import bus_frequency
from orchestrator.watch.finding import UNSTABLE


@dataclass(frozen=True)
class MeasuredRow:
    """The response of one row. Powers are in pu of the plant's rating.

    Attributes
    ----------
    times
        [s], shape (n,), evenly spaced.
    signals
        By the bench's names, each of shape (n,).
    f_n
        Rated frequency [Hz].
    events
        When something changed [s].
    findings
        Of the watch over the run, in the form of `Finding.as_json`.
    declared
        What the applicant declares of the converter, by name.
    """

    times: Numbers
    signals: Mapping[str, Numbers]
    f_n: float
    events: tuple[float, ...]
    findings: tuple[Mapping[str, Any], ...] = ()
    declared: Mapping[str, float] = field(default_factory=dict)

    @property
    def p(self) -> Numbers:
        """Active power of the plant [pu]."""
        return self.signals["p"]

    @cached_property
    def mean_p(self) -> Numbers:
        """Active power of the plant, averaged over the period before each instant [pu]."""
        return over_a_period(self.p, self.times, self.f_n)

    @cached_property
    def mean_v(self) -> Numbers:
        """Voltage magnitude at the connection point, averaged over the period before each instant [pu]."""
        return over_a_period(self.signals["v"], self.times, self.f_n)

    @cached_property
    def frequency(self) -> Numbers:
        """Frequency at the connection point [Hz]."""
        return bus_frequency(self.times, self.signals["v_re"], self.signals["v_im"], self.f_n)

    def within(self, begin: float, end: float) -> slice:
        """The rows from a time on, up to and without another [s]."""
        first, last = np.searchsorted(self.times, (begin - 1e-9, end - 1e-9))
        return slice(int(first), int(last))

    def before(self, time: float) -> float:
        """Active power just before an event [pu]: the mean over half a second, or what there is."""
        return float(np.mean(self.p[self.within(max(0.0, time - 0.5), time)]))

    def until(self, time: float) -> float:
        """When the next change after a time comes, or the end of the run [s]."""
        return min((event for event in self.events if event > time + 1e-9), default=float(self.times[-1]))

    @property
    def faults(self) -> list[str]:
        """What the watch found that no stable system does."""
        return [str(f["message"]) for f in self.findings if f["kind"] in UNSTABLE]


def over_a_period(values: Numbers, times: Numbers, f_n: float) -> Numbers:
    """Mean over the period of the grid before each instant; at the start over what there is."""
    count = max(1, round(1 / f_n / (times[1] - times[0])))
    sums = np.concatenate([[0.0], np.cumsum(values)])
    here = np.arange(1, len(values) + 1)
    first = np.maximum(here - count, 0)
    return np.asarray((sums[here] - sums[first]) / (here - first))
