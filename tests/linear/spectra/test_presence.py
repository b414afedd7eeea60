"""On the way from one system to another, each device's current counts in its part, as in numbers by hand."""

import numpy as np
import pytest
import scipy.sparse as sp

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.presence import PresenceWay

STEP = 0.01
"""Communication step of both systems [s]."""


def system(gain, lag=None):
    """A grid x⁺ = 0.5·x + w, and a device w = gain·x, or behind a state of its own d⁺ = lag·d + x, w = gain·d."""
    if lag is None:
        F, G, H, names = [[0.5]], [[1.0]], [[gain]], ("grid.x",)
    else:
        F, G, H = [[0.5, 0.0], [1.0, lag]], [[1.0], [0.0]], [[0.0, gain]]
        names = ("grid.x", "device.d")
    return LinearModel(
        *(sp.csr_array(np.array(one)) for one in (F, G, H, [[0.0]])),
        names=names,
        step_size=STEP,
        disagreement=0.0,
        wires=("device.w",),
    )


@pytest.mark.parametrize("part", [0.0, 0.25, 1.0])
def test_each_device_counts_in_its_part(part):
    way = PresenceWay(system(0.1), system(0.3), {"device"})
    (value,) = way.model_at(part).A.ravel()
    assert value == pytest.approx(0.5 + (1 - part) * 0.1 + part * 0.3)


def test_a_mode_is_followed_to_the_system_without_and_one_of_the_devices_own_is_in_none():
    way = PresenceWay(system(0.1), system(0.02, lag=0.9), {"device"})
    fast, slow = np.log(np.sort(np.linalg.eigvals([[0.5, 0.02], [1.0, 0.9]]))) / STEP
    assert way.followed_back(complex(fast)) == pytest.approx(np.log(0.6) / STEP)
    assert way.followed_back(complex(slow)) is None
