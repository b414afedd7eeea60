"""With the device a place's figure is that of the same mode, whichever is the least damped one there."""

import numpy as np
import pytest

from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.siting.placing import converter, with_devices
from orchestrator.studies.siting.study import SiteRequest, find_sites
from tests.studies.screening.five_machines import five_machines

BUS, OURS = "bus_11", 100.0
RATINGS = (*np.geomspace(6.0, OURS, 4).tolist(),)  # [MVA]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    case = five_machines(tmp_path_factory.mktemp("five"))
    return find_sites(case, SiteRequest("pod_p", confirm=1, buses=(BUS,)))


def grown(result):
    """The least damped mode without the device, while one grows there from 6 to 100 MVA: always the nearest one."""
    value = result.intact.modes[0].mode.eigenvalue
    for rating in RATINGS:
        device = converter(result.prepared, rating, "pod_p")
        (prepared,) = with_devices(result.case, device, [BUS]).prepare()
        values = [mode.eigenvalue for mode in compute_modes(prepared, (0.1, 5.0)).modes]
        value = min(values, key=lambda other: abs(other - value))
    return value, values


def test_the_mode_with_the_device_is_the_one_without_it(found):
    (one,) = found.confirmations
    value, others = grown(found)
    assert one.with_device == pytest.approx(value, rel=1e-4)
    assert min(map(damping_percent, others)) <= damping_percent(value) + 1e-9
    assert one.least_damping <= one.damping + 1e-9
