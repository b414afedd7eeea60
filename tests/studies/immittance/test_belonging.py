"""Two sides whose loop has a size that only other units explain."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.immittance.belonging import _is_of, check_size
from orchestrator.studies.immittance.sides import Known


@pytest.mark.parametrize(
    ("size", "refused"), [(0.002, True), (0.004, False), (25.0, False), (40.0, True)]
)
def test_a_loop_that_is_far_too_weak_or_strong_asks_for_units(size, refused):
    """As large at the middle of 1 to 100 Hz, by a reactance."""
    sides = {"device": SimpleNamespace(name="device"), "network": SimpleNamespace(name="network")}
    loop = SimpleNamespace(
        values=lambda s: (size * np.abs(s) / (2 * np.pi * 10))[:, None, None] * np.eye(2), **sides
    )
    if refused:
        with pytest.raises(InputError, match=f"is {size:.2g} at most frequencies"):
            check_size(loop, 1.0, 100.0)
    else:
        check_size(loop, 1.0, 100.0)


def test_a_side_that_is_known_is_looked_at_at_its_poles():
    side = Known()
    side.poles = 2 * np.pi * np.array([-1 + 50j, -1 - 50j, -3, -0.1 + 2j, -0.1 - 2j])
    assert side.frequencies == pytest.approx([0, 2, 2, 50, 50])


@pytest.mark.parametrize(("shift", "same"), [(0.0, True), (3.0, False)])
def test_a_determinant_is_that_of_its_eigenvalues_and_poles_but_for_a_factor(shift, same):
    hertz = np.geomspace(0.1, 500, 400)
    s = 2j * np.pi * hertz
    eigenvalues, side = np.array([-2 + 30j, -2 - 30j, -50]), Known()
    side.poles = np.array([-5 + 10j, -5 - 10j, -8])
    det = 0.3 * np.prod(s[:, None] - eigenvalues, axis=1) / np.prod(s[:, None] - side.poles, axis=1)
    path = SimpleNamespace(s=s, hertz=hertz, det=det)
    cut = SimpleNamespace(eigenvalues=eigenvalues + shift, device=side, network=None)
    assert _is_of(SimpleNamespace(path=path), cut) is same
