"""Whether a growing mode is the coupling's doing or the system's own, on systems whose growth is known."""

from math import exp, log

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.stability import judge
from orchestrator.studies.modes.modes import compute_modes
from tests.systems.coupling.small_fmus import small_fmu

H = 1e-3


def case_of(folder, gains, schedule):
    """Two integrators in a ring: λ² = gain·gain'."""
    model = small_fmu("integrator").path
    path = folder / "ring.toml"
    path.write_text(
        f"""\
name = "ring"
[solver]
step_size = {H}
schedule = "{schedule}"
[components.a]
fmu = '{model}'
parameters = {{ gain = {gains[0]} }}
[components.b]
fmu = '{model}'
parameters = {{ gain = {gains[1]} }}
[[connections]]
from = "a.y"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
[scenarios.one]
title = "One"
""",
        encoding="utf-8",
    )
    return load_case(path)


def judged(folder, gains, schedule="jacobi"):
    case = case_of(folder, gains, schedule)
    (prepared,) = case.prepare(["one"], {})
    return compute_modes(prepared, (0.0, 100.0))


@pytest.mark.parametrize("w", [5.0, 40.0, 90.0])
def test_a_coupling_that_makes_an_oscillation_grow_is_named(tmp_path, w):
    """Side by side, two integrators that swing for ever grow: µ = 1 ± jwH."""
    found = judged(tmp_path, (w, -w))
    growth = log(1 + (w * H) ** 2) / (2 * H)
    assert (found.stability.stable, found.stability.cause) == (False, "coupling")
    assert found.stability.largest_growth_rate == pytest.approx(growth, rel=1e-6)
    assert any("coupling" in text and f"{growth:.3g} 1/s" in text for text in found.warnings)


@pytest.mark.parametrize("rate", [0.5, 3.0, 30.0])
def test_a_system_that_grows_by_itself_is_not_the_couplings_doing(tmp_path, rate):
    """λ = ±rate: µ = 1 + rate·H side by side, a little less than the system's own growth."""
    found = judged(tmp_path, (rate, rate))
    assert (found.stability.stable, found.stability.cause) == (False, "system")
    assert found.stability.largest_growth_rate == pytest.approx(log(1 + rate * H) / H, rel=1e-6)
    assert not [text for text in found.warnings if "coupling" in text]


def one_state(rate, step_size=None):
    """A model of one state that grows at a rate [1/s]."""
    return LinearModel.from_matrix(
        np.array([[rate if step_size is None else exp(rate * step_size)]]), ("x",), step_size
    )


@pytest.mark.parametrize(
    ("coupled", "alone", "cause"),
    [
        (2.9, 1.0, "system"),
        (3.1, 1.0, "coupling"),
        (0.5, -1.0, "coupling"),
        (0.9, 0.01, "system"),
        (20.0, 10.0, "system"),
    ],
)
def test_a_step_map_that_grows_by_more_than_twice_the_systems_rate_owes_that_to_the_coupling(
    coupled, alone, cause
):
    """By twice and another 1 1/s: of a system that grows hardly, a rate of 0.9 1/s is not yet the coupling's."""
    assert judge(one_state(coupled, H), system=one_state(alone)).cause == cause
