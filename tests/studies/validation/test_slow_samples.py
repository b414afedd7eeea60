"""Which of a device's times are too fast for slow samples: those whose corner 1/(2πτ) is beyond half their rate."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.validation.event import _slow_samples
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
        (0.05, "faster than 10 Hz: controls that act faster (filter.tau = 0.01 s)"),
        (0.06, "faster than 8.33 Hz: controls that act faster (filter.tau = 0.01 s)"),
        (0.2, "(filter.tau = 0.01 s, voltage_control.tau = 0.05 s)"),  # 15.9 and 3.2 Hz beyond 2.5
    ],
)
def test_times_are_named_by_their_corner_frequency(interval, named):
    (said,) = said_of(interval)
    assert named in said
