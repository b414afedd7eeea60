"""``gfor linearize``: a scenario's A, B, C, D for other tools."""

import argparse
from pathlib import Path

from orchestrator.cli.case_arguments import add_case_arguments, prepare
from orchestrator.cli.terminal import made_folder
from orchestrator.report.linear_model_files import save_linear_model
from orchestrator.study.linear import default_inputs, default_outputs, linear_model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor linearize``."""
    add_case_arguments(parser)
    parser.add_argument(
        "--input",
        action="append",
        metavar="COMPONENT.VARIABLE",
        help="tunable parameter or open input (repeatable; default: what the scenario's events change)",
    )
    parser.add_argument(
        "--output",
        action="append",
        metavar="COMPONENT.VARIABLE",
        help="observed output (repeatable; default: what the case plots)",
    )
    parser.add_argument("--continuous", action="store_true", help="ẋ = A·x + B·u instead of the step map")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder (default: results/<case>_linear)")


def run(options: argparse.Namespace) -> int:
    """Linearise every scenario and write its model."""
    case, scenarios = prepare(options)
    folder = made_folder(options.out or Path("results") / f"{case.name}_linear")
    for prepared in scenarios:
        inputs = options.input or default_inputs(prepared)
        outputs = options.output or default_outputs(case, prepared)
        model, point = linear_model(prepared, inputs, outputs, as_continuous=options.continuous)
        paths = save_linear_model(model, point, case, prepared, folder / prepared.name)
        size = f"{len(model.states)} states, {len(model.inputs)} inputs, {len(model.outputs)} outputs"
        kind = "continuous" if model.step_size is None else f"step map of {model.step_size:g} s"
        print(f"{prepared.name}: {kind}, {size}: {', '.join(map(str, paths))}")
    return 0
