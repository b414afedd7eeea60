"""Legends below pictures."""

import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from orchestrator.output.report.plot_style import add_legend


@pytest.mark.parametrize(
    ("longest", "columns"), [(10, 3), (26, 3), (27, 2), (42, 2), (43, 1), (200, 1)]
)
def test_a_legend_has_as_many_columns_as_its_longest_label_leaves_room_for(longest, columns):
    figure = Figure()
    add_legend(figure, [Line2D([], []) for _ in range(4)], ["x", "y", "z", "x" * longest])
    assert figure.legends[0]._ncols == columns
