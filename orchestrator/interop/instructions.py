"""The page of instructions that is written beside the two probe FMUs."""

from orchestrator.interop.candidates import SIGNALS
from orchestrator.interop.which_master import STEP_SIZE, STOP_TIME

_PAGE = """\
# Which schedule does your tool run?

`probe_a.fmu` and `probe_b.fmu` (FMI 2.0 co-simulation, {platforms}) are two small lags. Coupled in a loop they
move differently in every master: by who steps first, by what the inputs hold in the first step, by when outputs are
recorded, and by what time a row is given.

1. Add both FMUs and call the instances `a` (of `probe_a.fmu`) and `b` (of `probe_b.fmu`). Change no parameter and no
   start value.
2. Connect **`a.y` → `b.u`** and **`b.y` → `a.u`**, in this order.
3. Communication step **{step:g} s**, fixed; from 0 to **{stop:g} s**.
4. Record one row a step: the time, {signals}.
   `a.y` and `b.y` are what is needed; the others settle what those two leave open.
5. Export as CSV with a heading, with as many digits as the tool gives, and:

       gfor master which RESULT.csv{options}

Columns are told by the end of their headings (`a.y`, `probe_a::y`, `system/a/y [1]`). For other headings add
`--column a.y=HEADING`. Rows between communication points are left out. If the tool cannot take this step or duration,
take others and say so with `--step` and `--stop`.
"""


def instructions(step_size: float, stop_time: float, platforms: tuple[str, ...]) -> str:
    """How to couple and run the probe pair in another tool."""
    signals = ", ".join(f"`{signal}`" for signal in SIGNALS)
    usual = (step_size, stop_time) == (STEP_SIZE, STOP_TIME)
    options = "" if usual else f" --step {step_size:g} --stop {stop_time:g}"
    return _PAGE.format(
        step=step_size, stop=stop_time, signals=signals, platforms=", ".join(platforms), options=options
    )
