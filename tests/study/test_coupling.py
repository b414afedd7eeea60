"""Whether a growing mode is the coupling's doing or the system's own, on systems whose growth is known."""

from math import log

import pytest

from orchestrator.cases.case import load_case
from orchestrator.study.modes import compute_modes
from tests.coupling.small_fmus import small_fmu

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


def warned(folder, gains, schedule="jacobi"):
    case = case_of(folder, gains, schedule)
    (prepared,) = case.prepare(["one"], {})
    warnings = compute_modes(case, prepared, (0.0, 100.0)).warnings
    return [text for text in warnings if "coupling" in text]


@pytest.mark.parametrize(("w", "said"), [(40.0, False), (50.0, True)])
def test_a_coupling_that_makes_an_oscillation_grow_is_named(tmp_path, w, said):
    """Side by side, two integrators that swing for ever grow: µ = 1 ± jwH."""
    growth = log(1 + (w * H) ** 2) / (2 * H)
    assert (growth > 1.0) == said
    found = warned(tmp_path, (w, -w))
    assert bool(found) == said
    assert all(f"{growth:.3g} 1/s" in text for text in found)


@pytest.mark.parametrize("rate", [3.0, 30.0])
def test_a_system_that_grows_by_itself_is_not_the_couplings_doing(tmp_path, rate):
    """λ = ±rate: µ = 1 + rate·H side by side, a little less than the system's own growth."""
    assert not warned(tmp_path, (rate, rate))
