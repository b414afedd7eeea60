"""The guide to faults and outages: what it says of its case is computed."""

import numpy as np
import pytest

import orchestrator as gfor
from tests.pages.markdown import ROOT, blocks
from tests.support.printed import in_markdown

GUIDE = ROOT / ".docs" / "how-to" / "faults-and-outages.md"

pytestmark = pytest.mark.slow


@pytest.fixture
def case(tmp_path):
    for block in blocks(GUIDE):
        if block.kind == "file":
            (tmp_path / block.path).write_text(block.text, encoding="utf-8")
    return gfor.load(tmp_path / "nine.toml")


def test_the_modes_of_each_outage(case):
    table, *_ = in_markdown(GUIDE.read_text(encoding="utf-8"))
    rows = {row[0].strip("`"): (float(row[1]), float(row[2])) for row in table[1:]}
    assert len(rows) == 7
    for line, shown in rows.items():
        overrides = {} if line == "none" else {f"grid.{line}.connected": False}
        (mode,) = case.scenario("cleared", overrides).modes().named.values()
        assert (mode.frequency_hz, mode.damping_percent) == (
            pytest.approx(shown[0], abs=6e-4),
            pytest.approx(shown[1], abs=6e-3),
        )
    lines = {line: values for line, values in rows.items() if line != "none"}
    assert min(lines, key=lambda line: lines[line][1]) == "line_4_6"
    assert min(lines, key=lambda line: lines[line][0]) == "line_5_7"


@pytest.mark.parametrize(("stop", "kinds"), [(5.0, {"not_judged"}), (10.0, set())])
def test_a_fault_that_is_cleared_in_time_is_no_growth(case, stop, kinds):
    """Two swings beat, and magnitudes have their harmonics: until 5 s they seem to grow."""
    assert {finding.kind for finding in case.scenario("cleared").run(stop=stop).findings} <= kinds


def test_a_late_clearing_loses_synchronism(case):
    lost = {}
    for name in ("cleared", "late"):
        run = case.scenario(name).run(stop=3.0)
        kinds = {finding.kind for finding in run.findings}
        assert "growing_oscillation" not in kinds
        assert name == "late" or "not_judged" in kinds
        lost[name] = [finding for finding in run.findings if finding.kind == "loss_of_synchronism"]
        time = run.signal("sg1.omega").time.values
        current = np.hypot(
            *(run.signal(f"grid.bus_7.fault.i_{part}").values for part in ("re", "im"))
        )
        assert current.max() == pytest.approx(17.8, abs=0.05)
        assert current[time < 1.08][-1] == pytest.approx(11.9, abs=0.1)
    assert not lost["cleared"]
    assert [finding.component for finding in lost["late"]] == ["sg1"]
