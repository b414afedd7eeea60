"""Text that somebody else wrote, with brackets in it, is shown to the letter: rich would take it for a style."""

import ast
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from rich.console import Console

from orchestrator.face.cli import main
from orchestrator.face.cli.terminal import warn
from orchestrator.output.report.plot_style import add_legend, save_figure
from orchestrator.output.report.terminal_tables import make_table
from tests.devices.acceptance.gallery.build import Source, Variable, build

ROOT = Path(__file__).parents[3]
GAIN = (
    Variable("u", 0, "input", 0, "1"),
    Variable("v[d]", 1, "output", unit="1", depends=("u",)),
    Variable("k", 2, "parameter", 2, "1", variability="tunable"),
)


@pytest.mark.parametrize(
    "described", ["Voltage, phase peak [kV]", "Rate [/s]", "[bold]loud[/bold] :warning:"]
)
def test_info_shows_what_the_file_says(described, tmp_path, capsys):
    def with_text(text):
        return text.replace(b'name="k"', f'name="k" description="{described}"'.encode())

    source = replace(Source("odd", "small.c", {"MODEL_GAIN": 1}, GAIN), change=with_text)
    assert main(["fmu", "info", str(build(source, tmp_path))]) == 0
    printed = capsys.readouterr().out
    assert described in printed
    assert "v[d]" in printed


def test_titles_headings_and_cells_of_a_table_are_shown_to_the_letter():
    table = make_table("Case [red]", "Damping [/%]", "[pu]")
    table.add_row("a.b [pu]", "[/nonsense]")
    shown = StringIO()
    Console(file=shown, width=100).print(table)
    for text in ("Case [red]", "Damping [/%]", "[pu]", "a.b [pu]", "[/nonsense]"):
        assert text in shown.getvalue()


def test_a_warning_with_brackets_is_shown_to_the_letter(capsys):
    warn("odd[/]", ["machine.v[q] is at its limit [/pu]"])
    assert "scenario 'odd[/]': machine.v[q] is at its limit [/pu]" in capsys.readouterr().err


def test_dollar_signs_in_a_title_or_label_begin_no_formula(tmp_path):
    """Matplotlib would end with an error: what stands between them is no formula."""
    figure = Figure()
    axes = figure.subplots()
    axes.plot([1, 10], [1, 100], label="sg$1^$.omega")
    axes.set(xscale="log", ylabel="cost $_$ [pu]")
    axes.set_title("tariff $^$", loc="left")
    add_legend(figure, *axes.get_legend_handles_labels())
    save_figure(figure, tmp_path / "odd.png")
    assert (tmp_path / "odd.png").stat().st_size
    ticks = [label for label in axes.get_xticklabels() if label.get_text()]
    assert ticks
    assert all(label.get_parse_math() for label in ticks)


def test_every_table_is_one_that_shows_its_cells_to_the_letter():
    """No module makes rich's own table."""
    for path in (ROOT / "orchestrator").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "from rich.table import Table" not in text:
            continue
        calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
        named = {call.func.id for call in calls if isinstance(call.func, ast.Name)}
        assert "Table" not in named, path.relative_to(ROOT)
