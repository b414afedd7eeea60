"""A device whose current follows its voltage at once diverges with the network; it is named before another fails."""

import json

import pytest

from orchestrator.face.cli import main
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter
from tests.devices.acceptance.test_late_outputs import CASE

pytestmark = pytest.mark.usefixtures("undrawn")


def run(source, folder, capsys):
    """What `gfor run` says of a case with this converter: its JSON, and standard error."""
    path = folder / "case.toml"
    path.write_text(CASE.format(fmu=build(source, folder).as_posix()), encoding="utf-8")
    code = main(["run", str(path), "--json", "--stop", "0.02", "--out", str(folder / "out")])
    printed = capsys.readouterr()
    return code, json.loads(printed.out), printed.err


@pytest.mark.parametrize("X_PU", [0.25, 0.1])
def test_an_algebraic_current_is_named(X_PU, tmp_path, capsys):
    source = converter("algebraic", ALGEBRAIC=1, X_PU=X_PU, RATING=200.0, depends=("v_re", "v_im"))
    _, (summary,), said = run(source, tmp_path, capsys)
    assert "component 'box': i_" in said
    assert "grows" in said
    assert "L·di/dt" in said
    assert any("component 'box'" in text for text in summary["warnings"])


@pytest.mark.parametrize(
    "options", [{}, {"X_PU": 0.1}, {"SHUNT": 0.05, "depends": ("v_re", "v_im")}]
)
def test_a_current_that_is_a_state_is_not_named(options, tmp_path, capsys):
    code, _, said = run(converter("stateful", RATING=200.0, **options), tmp_path, capsys)
    assert code == 0
    assert "grows" not in said
