"""``gfor modes --black-box --component``: modes of a system with a device that is known only through FMI."""

import argparse
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.case_arguments import excitation_of, prepare
from orchestrator.face.cli.terminal import make_console, print_json, said_stages, warn
from orchestrator.face.cli.verdict import exit_code, print_stability
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, Mode
from orchestrator.linear.spectra.stability import Stability, judge
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.black_box.coupled_modes import (
    BoxedSystem,
    component_participation,
    is_black_box,
    linearize_with_box,
)
from orchestrator.studies.black_box.files import identification_json, save_identification
from orchestrator.studies.black_box.fitting import passivity
from orchestrator.studies.modes.modes import modes_of, running


def run(options: argparse.Namespace) -> int:
    """Modes of a case's scenarios with one component identified, beside those from its states where it shows them."""
    scenarios = prepare(options)
    console = make_console(stderr=options.json)
    folder = made_folder(
        options.out or Path("results") / f"{scenarios[0].case.name}_black_box", "--out"
    )
    output, run_id = [], new_run_id()
    verdicts: dict[str, Stability] = {}
    for prepared in scenarios:
        with running(prepared) as master, said_stages() as report:
            restore = False if options.no_state else None
            system = linearize_with_box(
                master, options.component, excitation_of(options), restore=restore, report=report
            )
            box = is_black_box(master.components[options.component])
            white = [] if box else modes_of(prepared, master, ELECTROMECHANICAL_HZ).modes
        verdicts[prepared.title] = judge(system.model).doubted(system.misfits)
        passive = passivity(system.response)
        with staged(folder / prepared.name, run_id) as staging:
            save_identification(system.response, system.identified, passive, staging)
        warn(prepared.name, system.warnings)
        if options.json:
            output.append(
                _system_json(prepared.name, system, verdicts[prepared.title], passive, white)
            )
        else:
            print_stability(console, {prepared.title: verdicts[prepared.title]})
            console.print(_modes_table(prepared.title, system, white), "")
    if options.json:
        print_json(output)
    else:
        console.print(
            escape(f"Admittances and models in {folder}"), soft_wrap=True, highlight=False
        )
    return exit_code(options, list(verdicts.values()))


def _modes_table(title: str, system: BoxedSystem, white: list[Mode]) -> Table:
    fitted = f"order {len(system.identified.A)}, fit {system.identified.error:.1e}"
    columns = ["f [Hz]", "Damping [%]", "the box takes part [%]"]
    columns += ["with its states: f [Hz]", "Damping [%]", "takes part [%]"] if white else []
    table = make_table(f"{title}: {system.component} as a black box, {fitted}", *columns, left=0)
    for mode in system.modes():
        share = component_participation(mode, system.component)
        row = [f"{mode.frequency_hz:.4f}", f"{mode.damping_percent:.3f}", f"{100 * share:.2f}"]
        other = min(white, key=lambda m: abs(m.eigenvalue - mode.eigenvalue), default=None)
        if other is not None:
            share = component_participation(other, system.component)
            row += [
                f"{other.frequency_hz:.4f}",
                f"{other.damping_percent:.3f}",
                f"{100 * share:.2f}",
            ]
        table.add_row(*row)
    return table


def _system_json(
    name: str, system: BoxedSystem, stability: Stability, passive: Any, white: list[Mode]
) -> dict[str, Any]:
    def figures(mode: Mode) -> dict[str, float]:
        participation = component_participation(mode, system.component)
        return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {
            "participation": participation
        }

    return {
        "scenario": name,
        "component": system.component,
        "residual": system.residual,
        "stable": stability.stable,
        "largest_growth_rate": stability.largest_growth_rate,
        "stability": stability.as_json(),
        "linearised": dict(system.model.sources),
        "warnings": list(system.warnings),
        "identification": identification_json(system.response, system.identified, passive),
        "modes": [figures(m) for m in system.modes()],
        "white_box_modes": [figures(m) for m in white],
    }
