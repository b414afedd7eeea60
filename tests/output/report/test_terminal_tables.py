"""Tables of a terminal: headings as they are written, long lists in short, the variables of an FMU."""

import io

import pytest
from rich.console import Console

from orchestrator.devices.fmi.description import read_description
from orchestrator.output.report.fmu_variables import fmu_variables
from orchestrator.output.report.mode_tables import eigenvalue_text
from orchestrator.output.report.short_texts import first_few
from orchestrator.output.report.terminal_tables import make_table


def printed(table, width=160):
    console = Console(file=io.StringIO(), width=width)
    console.print(table)
    return console.file.getvalue()


def test_units_in_square_brackets_are_no_style():
    table = make_table("Modes [red]", "Mode [rad/s]", "f [Hz]", "[bold]")
    assert all(
        text in printed(table) for text in ("Modes [red]", "Mode [rad/s]", "f [Hz]", "[bold]")
    )


@pytest.mark.parametrize(
    ("count", "shown"), [(5, "0, 1, 2, 3, 4"), (6, "0, 1, 2, 3, 4 … 6 in all"), (0, "")]
)
def test_a_long_list_is_cut_and_counted(count, shown):
    assert first_few(range(count), str) == shown


def test_an_eigenvalue_shows_the_sign_of_its_real_part():
    assert eigenvalue_text(0.0322 - 3.5949j) == "+0.0322 ± j3.5949"
    assert eigenvalue_text(-20.4683 + 5.5214j, 2) == "-20.47 ± j5.52"


def test_every_variable_of_an_fmu_stands_in_the_table_of_its_causality(fmu_path):
    description = read_description(fmu_path("infinite_bus"))
    tables = list(fmu_variables(description))
    for table in tables:
        causality = str(table.title).partition(" ")[0]
        names = {v.name for v in description.variables.values() if v.causality == causality}
        assert {str(cell) for cell in table.columns[0].cells} == {
            name for name in names if not name.startswith("der(")
        }
    (inputs,) = (table for table in tables if str(table.title).startswith("input "))
    row = {str(c.header): str(next(iter(c.cells))) for c in inputs.columns}
    known = description.variables[row["Name"]]
    assert (row["Unit"], row["Description"]) == (known.unit, known.description)
    assert "e30" not in printed(inputs), "a bound that is not declared"
