"""Which of a device's times are too fast for slow samples: those that are shorter than the interval between them."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.validation.event import _slow_samples
from orchestrator.studies.validation.fit import Untold, identifiable
from orchestrator.studies.validation.held_by_samples import is_too_fast
from orchestrator.studies.validation.parameters import Adjustable
from orchestrator.studies.validation.words import sentence

TAUS = {"droop.tau_P": 0.1, "voltage_control.tau": 0.05, "filter.tau": 0.01, "off.tau": 0.0}


def said_of(interval):
    info = {
        name: SimpleNamespace(name=name, causality="parameter", type="Real", unit="s")
        for name in TAUS
    }
    device = SimpleNamespace(
        description=SimpleNamespace(variables=info), value=lambda name: TAUS[name]
    )
    event = SimpleNamespace(recording=SimpleNamespace(interval=interval))
    return [sentence(one) for one in _slow_samples(SimpleNamespace(event=event, device=device))]


@pytest.mark.parametrize(
    ("interval", "named"),
    [
        (0.05, "above 3.18 Hz: controls that act faster (filter.tau = 0.01 s)"),
        (
            0.06,
            "above 2.65 Hz: controls that act faster (filter.tau = 0.01 s, voltage_control.tau = 0.05 s)",
        ),
        (
            0.08,
            "above 1.99 Hz: controls that act faster (filter.tau = 0.01 s, ",
        ),  # 15.9 and 3.2 Hz; 1.6 is below
    ],
)
def test_times_are_named_by_their_corner_frequency(interval, named):
    (said,) = said_of(interval)
    assert named in said


class EachItsOwnWay:
    """Errors that every parameter moves by a way of its own, at samples so far apart [s]."""

    def __init__(self, interval):
        event = SimpleNamespace(recording=SimpleNamespace(interval=interval))
        self.stretches = [SimpleNamespace(rows=np.arange(200), event=event)]
        self.ways = np.random.default_rng(1).standard_normal((400, len(TAUS)))

    def at(self, values):
        return self.ways[:, 0]

    def slopes(self, values, steps):
        return 1e4 * self.ways[:, : len(steps)]

    def hidden_slopes(self, values):
        return np.empty((len(self.ways), 0))


@pytest.mark.parametrize("interval", [0.05, 0.2])
def test_a_fit_leaves_the_times_that_the_question_names(interval):
    numbers = [Adjustable(name, "s", tau, 0.0, 10.0) for name, tau in TAUS.items()]
    told, untold = identifiable(EachItsOwnWay(interval), numbers, {})
    (said,) = said_of(interval)
    assert {name for name in untold if name in said} == set(untold)
    assert not any(f"{one.name} =" in said for one in told)
    assert {why for why, _ in untold.values()} <= {Untold.TOO_FAST}


def test_a_time_of_one_interval_is_told():
    assert not is_too_fast(0.05001, 0.05)
    assert is_too_fast(0.04999, 0.05)
    assert not is_too_fast(0.0, 0.05)
