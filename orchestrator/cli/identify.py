"""``gfor identify``: the modes in a recorded signal."""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from orchestrator.analysis.identification import IdentifiedMode, interval_used
from orchestrator.cli.terminal import make_console, make_errors
from orchestrator.results.mode_json import eigenvalue_json
from orchestrator.study.comparison import open_trajectory, recorded, strongest_modes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor identify``."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a scenario's results, or its trajectory.nc")
    parser.add_argument("signal", metavar="SIGNAL", help="'a.b' or 'a.b - c.d'")
    parser.add_argument("--start", type=float, default=2.0, metavar="T", help="beginning of the free response [s] (2)")
    parser.add_argument("--stop", type=float, metavar="T", help="its end [s] (default: the run's)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Write a recorded signal as a sum of modes."""
    curve = recorded(open_trajectory(options.run), options.signal, str(options.run))
    modes = strongest_modes(curve, options.start, options.stop)
    interval = interval_used(curve["time"].sel(time=slice(options.start, options.stop)).values)
    remarks = list(_remarks(modes, interval))
    if options.json:
        print(json.dumps([mode_json(m) for m in modes], indent=1))
        for text in remarks:
            make_errors().print(text, soft_wrap=True, highlight=False)
        return 0
    end = options.stop if options.stop is not None else float(curve["time"][-1])
    title = f"{options.signal} from {options.start:g} to {end:g} s (matrix pencil), strongest first"
    table = Table(title=title, title_justify="left", header_style="bold")
    for column in ("λ [rad/s]", "f [Hz]", "Damping [%]", "Amplitude"):
        table.add_column(column, justify="right")
    for m in modes:
        value = f"{m.eigenvalue.real:+.4f} ± j{abs(m.eigenvalue.imag):.4f}"
        table.add_row(value, f"{m.frequency_hz:.4f}", f"{m.damping_percent:.2f}", f"{m.amplitude:.3g}")
    console = make_console()
    console.print(table)
    for text in remarks:
        console.print(text, soft_wrap=True, highlight=False)
    return 0


def _remarks(modes: Sequence[IdentifiedMode], interval: float) -> Iterator[str]:
    """Up to which frequency samples so far apart [s] can show anything, and which modes are near it."""
    highest = 0.5 / interval
    yield (
        f"The samples used, every {interval:g} s, show nothing above {highest:.4g} Hz: "
        "a faster oscillation appears as a slower one."
    )
    near = [f"{m.frequency_hz:.4g} Hz" for m in modes if m.frequency_hz > highest / 2]
    if near:
        yield (
            f"Above a quarter of the sampling frequency of {1 / interval:.4g} Hz, and perhaps no frequency of the "
            f"system: {', '.join(near)}. Record more often (solver.record_interval) to be sure."
        )


def mode_json(mode: IdentifiedMode | None) -> dict[str, Any] | None:
    """The machine-readable form of an identified mode."""
    if mode is None:
        return None
    return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {"amplitude": mode.amplitude}
