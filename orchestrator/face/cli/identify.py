"""``gfor signal identify``: the modes in a recorded signal."""

import argparse

from rich.markup import escape

from orchestrator.core.errors import InputError
from orchestrator.core.units import whole_percent
from orchestrator.face.api.identification import ambient, identify
from orchestrator.face.cli.arguments import add_kept_argument, add_options
from orchestrator.face.cli.terminal import (
    keep_json,
    make_console,
    make_errors,
    print_json,
    print_parts,
    saying_warnings,
)
from orchestrator.output.report.mode_tables import eigenvalue_text
from orchestrator.output.report.terminal_tables import make_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "identify")
    add_kept_argument(parser, "ringing")


def run(options: argparse.Namespace) -> int:
    if options.ambient:
        return _ambient(options)
    if options.window or options.alarm is not None:
        raise InputError(
            "--window and --alarm belong to --ambient, which is not given; add it, or leave them out"
        )
    if len(options.signal) > 1:
        raise InputError(
            f"{len(options.signal)} signals: a free response is identified in one; give one, or --ambient"
        )
    with saying_warnings():
        start = 2.0 if options.start is None else options.start
        found = identify(options.run, options.signal[0], start, options.stop)
    keep_json(found.as_json(), options.out, "ringing")
    if options.json:
        print_json(found.as_json())
        for text in found.remarks:
            make_errors().print(text, soft_wrap=True, highlight=False)
        return 0
    title = (
        f"{found.signal} from {found.start:g} to {found.stop:g} s (matrix pencil), strongest first"
    )
    columns, rows = ("λ [rad/s]", "f [Hz]", "Damping [%]", "Amplitude"), []
    for m in found:
        figures = (f"{m.frequency_hz:.4f}{' ?' if m.doubts else ''}", f"{m.damping_percent:.2f}")
        shown = ("trend", "-") if found.is_trend(m) else figures
        rows.append((eigenvalue_text(m.eigenvalue), *shown, f"{m.amplitude:.3g}"))
    table = make_table(title, *columns, left=0, rows=rows)
    print_parts(make_console(), [table, *map(escape, found.remarks)])
    return 0


def _ambient(options: argparse.Namespace) -> int:
    level = 3.0 if options.alarm is None else options.alarm
    with saying_warnings():
        found = ambient(
            options.run,
            options.signal,
            options.start or 0.0,
            options.stop,
            window=options.window,
            level=level,
        )
    if options.out:
        found.save(options.out)
    if options.json:
        print_json(found.as_json())
        return 0
    rows = [
        (
            f"{r.start:g}–{r.stop:g}",
            f"{r.frequency_hz:.3f} ± {r.frequency_error_hz:.3f}",
            f"{r.damping_percent:.1f} ± {r.damping_error_percent:.1f}",
            whole_percent(r.share),
            r.alarm,
        )
        for r in found.table().itertuples()
    ]
    columns = ("Window [s]", "f [Hz]", "Damping [%]", "Of variance", "Alarm")
    table = make_table(
        f"{found.label} in noise (stochastic subspace, 95 % intervals)", *columns, rows=rows
    )
    print_parts(make_console(), [table, escape(found.sentence)])
    return 0
