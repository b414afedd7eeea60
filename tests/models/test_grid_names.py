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


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("soutth", "; did you mean 'south'?"),
        ("NORTH", "; did you mean 'north'?"),
        ("line-7", "; did you mean 'bus_7'?"),
        ("elsewhere", ""),
    ],
)
def test_a_bus_that_does_not_exist_is_told_with_those_of_nearly_its_name(written, meant):
    with pytest.raises(ValueError, match="does not exist") as error:
        Network(
            "misspelt",
            ("north", "south", "bus_7"),
            (Line("tie", "north", "south", X=0.1), Line("far", "south", "bus_7", X=0.1)),
            (Load("city", written, 10.0),),
            (),
        )
    told = f"load 'city' is at bus {written!r}, which does not exist{meant}"
    assert told in str(error.value)
