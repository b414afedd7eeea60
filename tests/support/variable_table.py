"""Tables of variables in the leaflets of the FMU folders: `python -m tests.support.variable_table` renews them.

A leaflet keeps each table between ``<!-- variables:MODEL -->`` and ``<!-- /variables -->``.
"""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model import Model
from fmus.toolchain.variables import Parameter, Variable

ROOT = Path(__file__).parents[2]
LEAFLETS = tuple(ROOT / folder / "README.md" for folder in ("gfor_fmu", "fmus/synchronous_generator", "fmus/grid"))
SECTION = re.compile(r"(<!-- variables:(\w+) -->\n).*?(<!-- /variables -->)", re.DOTALL)


def variable_table(model: Model) -> str:
    """Markdown tables of all inputs, outputs, parameters, calculated parameters and states.

    The start of a calculated parameter and of a state is its value with all parameters at their starts.
    """
    c, x = (np.array(part).ravel() for part in model.initialise([p.start for p in model.parameters]))
    tables = [
        _table("Inputs", ("Start",), [(v, (_number(v.start),)) for v in model.inputs]),
        _table("Outputs", (), [(v, ()) for v in model.outputs]),
        _table(
            "Parameters",
            ("Start", "Range", "Set", "Source"),
            [
                (p, (_start(p), _range(p), "at any time" if p.tunable else "before start", p.source or "–"))
                for p in model.parameters
            ],
        ),
        _table(
            "Calculated parameters",
            ("At the start values",),
            [(v, (_number(value),)) for v, value in zip(model.calculated, c, strict=True)],
        ),
        _table(
            "States",
            ("At the start values",),
            [(v, (_number(value),)) for v, value in zip(model.states, x, strict=True)],
        ),
    ]
    return "\n".join(table for table in tables if table)


def with_tables(text: str) -> str:
    """A leaflet's text with every table made anew."""
    return SECTION.sub(lambda found: f"{found[1]}\n{variable_table(build_model(found[2]))}\n{found[3]}", text)


def main() -> None:
    """Rewrite the tables of all leaflets in place."""
    for leaflet in LEAFLETS:
        leaflet.write_text(with_tables(leaflet.read_text(encoding="utf-8")), encoding="utf-8")


def _table(title: str, columns: tuple[str, ...], rows: Iterable[tuple[Variable, tuple[str, ...]]]) -> str:
    lines = [_row(f"`{v.name}`", _unit(v), *cells, v.description) for v, cells in rows]
    if not lines:
        return ""
    head = ("Variable", "Unit", *columns, "Description")
    return "\n".join([f"**{title}** ({len(lines)})", "", _row(*head), "|---" * len(head) + "|", *lines, ""])


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _unit(variable: Variable) -> str:
    return f"{variable.unit} ({variable.base})" if variable.base else variable.unit


def _start(parameter: Parameter) -> str:
    return str(bool(parameter.start)).lower() if parameter.type == "Boolean" else _number(parameter.start)


def _range(parameter: Parameter) -> str:
    if parameter.type == "Boolean":
        return "true, false"
    low, high = parameter.minimum, parameter.maximum
    if low is None and high is None:
        return "any"
    if low is None or high is None:
        return f"≤ {_number(high)}" if low is None else f"≥ {_number(low)}"
    return f"{_number(low)} to {_number(high)}"


def _number(value: float) -> str:
    return "0" if abs(value) < 1e-12 else f"{value:.5g}"


if __name__ == "__main__":
    main()
