"""A case whose modes along a sweep can be computed by hand, at milliseconds a point."""

from pathlib import Path

from tests.systems.coupling.small_fmus import small_fmu

STEP = 1e-3


def two_oscillators(folder: Path) -> Path:
    """Two pairs of integrators in a loop, λ = ±j√(gain·gain'), and a lag that T ≤ 0 makes unusable.

    Both are at 1 Hz for a1.gain = 2π: there the case's mode "first", that of the pair a, crosses the other.
    """
    path = folder / "two_oscillators.toml"
    model = small_fmu("integrator").path
    path.write_text(
        f"""\
name = "two_oscillators"
[solver]
step_size = {STEP}
[components.a1]
fmu = '{model}'
parameters = {{ gain = {6.283185307179586} }}
[components.a2]
fmu = '{model}'
parameters = {{ gain = -6.283185307179586 }}
[components.b1]
fmu = '{model}'
parameters = {{ gain = {6.283185307179586} }}
[components.b2]
fmu = '{model}'
parameters = {{ gain = -6.283185307179586 }}
[components.slow]
fmu = '{small_fmu("lag").path}'
inputs = {{ u = 0 }}
[[connections]]
from = "a1.y"
to = "a2.u"
[[connections]]
from = "a2.y"
to = "a1.u"
[[connections]]
from = "b1.y"
to = "b2.u"
[[connections]]
from = "b2.y"
to = "b1.u"
[scenarios.one]
title = "One"
[scenarios.two]
title = "Two"
set = {{ "b1.gain" = 4.0 }}
[analysis]
modes = [{{ name = "first", states = ["a?.x"] }}]
swing = ["a?.x"]
""",
        encoding="utf-8",
    )
    return path
