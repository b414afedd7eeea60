"""Two sides whose loop has a size that only other units explain."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.errors import InputError
from orchestrator.immittance.belonging import check_size
from orchestrator.immittance.sides import Known


@pytest.mark.parametrize(("size", "refused"), [(0.002, True), (0.004, False), (25.0, False), (40.0, True)])
def test_a_loop_that_is_far_too_weak_or_strong_asks_for_units(size, refused):
    """As large at the middle of 1 to 100 Hz, by a reactance."""
    sides = {"device": SimpleNamespace(name="device"), "network": SimpleNamespace(name="network")}
    loop = SimpleNamespace(values=lambda s: (size * np.abs(s) / (2 * np.pi * 10))[:, None, None] * np.eye(2), **sides)
    if refused:
        with pytest.raises(InputError, match=f"is {size:.2g} at most frequencies"):
            check_size(loop, 1.0, 100.0)
    else:
        check_size(loop, 1.0, 100.0)


def test_a_side_that_is_known_is_looked_at_at_its_poles():
    side = Known()
    side.poles = 2 * np.pi * np.array([-1 + 50j, -1 - 50j, -3, -0.1 + 2j, -0.1 - 2j])
    assert side.frequencies == pytest.approx([0, 2, 2, 50, 50])
