"""An integral part that goes on at the current limit, beside an angle that comes to rest there."""

import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.frames import Phasor
from fmus.toolchain.native_fmu import NativeFmu
from gfor_fmu import inner_loops
from gfor_fmu.converter import grid_forming_converter
from orchestrator.devices.acceptance.checks.windup import _Left, _winds_up
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits

LIMITS = Limits(seconds=30.0)
DRIFTING = (13419794, 1372668, 21022)
"""Seeds of dips in which our converter's angle has not come to rest after 0.6 s: 0.4 pu·s more after 1.8 s, and after
5.4 s no more than that."""


def left(*away, rests=True):
    return [_Left(one, rests) for one in away]


@pytest.mark.parametrize(
    ("away", "winds_up"),
    [
        ((0.300, 0.571, 0.845), True),  # an integral: as much in each second
        ((0.300, 0.310, 0.312), False),
        ((1.031, 1.479, 1.478), False),  # a droop's angle that rests from 1 s on
        ((2.469, 16.69, 10.85), True),  # an integral that turns the angle around and around
        ((0.945, 0.987, 34.0), False),  # an angle that is lost of a sudden
        ((0.030, 0.055, 0.080), False),  # little
    ],
)
def test_what_goes_on_in_the_second_half_of_a_long_event_winds_up(away, winds_up):
    assert _winds_up(*left(*away)) is winds_up


def test_where_it_does_not_come_to_rest_a_difference_alone_accuses_nobody():
    assert not _winds_up(*left(12.0, 16.69, 10.85, rests=False))


def asked(file, seed):
    return check_fmu(file, None, LIMITS, ("anti_windup",), run_for=0.3, seed=seed).results[-1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", DRIFTING)
def test_our_converter_whose_angle_drifts_in_a_dip_is_not_accused(seed, fmu_path):
    found = asked(fmu_path("gfor", native=True), seed)
    assert found.verdict == "pass"
    assert found.figures["compared"] >= 1


@pytest.fixture
def wound(monkeypatch):
    """Our converter with a voltage loop whose integrators go on at the limit."""

    def goes_on(m, x, limit, found, k_i, error):
        x.set_derivative(m, Phasor(k_i * error.re, k_i * error.im))

    monkeypatch.setattr(inner_loops, "_integrate_what_is_left", goes_on)
    return cached(NativeFmu(grid_forming_converter()))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*DRIFTING, 11806001])
def test_our_converter_without_its_anti_windup_is_told(seed, wound):
    assert asked(wound, seed).fault == "winds up"
