"""The page of instructions that is written beside the two probe FMUs."""

from pathlib import Path

from orchestrator.interop.candidates import SIGNALS
from orchestrator.interop.which_master import STEP_SIZE, STOP_TIME


def instructions(step_size: float, stop_time: float, platforms: tuple[str, ...]) -> str:
    """How to couple and run the probe pair in another tool."""
    signals = ", ".join(f"`{signal}`" for signal in SIGNALS)
    usual = (step_size, stop_time) == (STEP_SIZE, STOP_TIME)
    options = "" if usual else f" --step {step_size:g} --stop {stop_time:g}"
    page = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    return page.format(step=step_size, stop=stop_time, signals=signals, platforms=", ".join(platforms), options=options)
