"""How the variables of a line are named."""

import pytest

from fmus.grid.grid import grid
from fmus.grid.names import line_variable, lines_among
from fmus.grid.network import Line, Load, Network


def test_the_grid_has_the_names_that_a_line_gives_its_variables():
    line = Line("tie", "a", "b", X=0.1, B=0.02, tap=1.1)
    network = Network(
        "two", ("a", "b"), (line,), (Load("city", "a", 10.0), Load("town", "b", 10.0)), ()
    )
    model = grid(network)
    names = {v.name for v in model.variables}
    wanted = [
        line.variable(q)
        for q in ("X", "R", "B", "tap", "shift", "connected", "i_re", "i_im", "p", "q")
    ]
    assert set(wanted) <= names
    assert lines_among(names) == ["tie"]


@pytest.mark.parametrize(
    ("quantity", "name"), [("X", "X_tie"), ("shift", "shift_tie"), ("connected", "tie.connected")]
)
def test_data_of_a_line_begin_with_the_quantity_and_all_else_with_the_line(quantity, name):
    assert line_variable("tie", quantity) == name
