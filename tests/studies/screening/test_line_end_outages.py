"""Outages that open a line at one end: the line stays charged from its other bus, or is dead with what hangs on it."""

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.studies.screening import outage_runs

SPUR = """\
name = "spur"
models = "phasor"
[solver]
stop_time = "0.5 s"
step_size = "1 ms"
[power_flow]
grid = "grid"
slack = "sg"
[network]
buses = ["b1", "b2", "b3", "b4"]
lines.l12 = { from = "b1", to = "b2", X = 0.02, R = 0.002, B = 0.04 }
lines.l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.04 }
lines.l31 = { from = "b3", to = "b1", X = 0.03, R = 0.003, B = 0.4 }
lines.l34 = { from = "b3", to = "b4", X = 0.04, R = 0.004, B = 0.8 }
loads.town = { bus = "b3", p = "500 MW", q = "80 Mvar" }
loads.works = { bus = "b2", p = "200 MW", q = "40 Mvar" }
loads.farm = { bus = "b4", p = "20 MW", q = "5 Mvar" }
[components.sg]
model = "synchronous_generator_st1"
bus = "b1"
parameters.S_n = "1000 MVA"
[components.vsc]
model = "gfor"
bus = "b2"
parameters = { S_n = "500 MVA", P_0 = 0.6, v_0 = 1.01 }
[components.grid]
model = "grid"
"""
L34 = 'lines.l34 = { from = "b3", to = "b4", X = 0.04, R = 0.004, B = 0.8 }\n'
FARM = 'loads.farm = { bus = "b4", p = "20 MW", q = "5 Mvar" }\n'
OPENING = 2e-4  # of an eigenvalue: the open end keeps a thousandth of its charging, so that it has a voltage


def case_of(folder, text=SPUR, name="case.toml"):
    (folder / name).write_text(text)
    return gfor.load(folder / name)


def critical(case, outages=None, **besides):
    """Return the eigenvalues of the critical modes at the last item, by frequency."""
    wanted = {"damping": 60, "frequencies": (0.02, 5.0), **besides}
    item = case.screen(outages=outages, sharing="slack", **wanted).result.items[-1]
    assert item.record.status == "computed", item.record.text
    return np.sort_complex(np.array(item.record.eigenvalues))


def charging(X, R, B):
    """Return the admittance [MW, Mvar at 1 pu] of a line that is open at its other end."""
    half = 0.5j * B
    y = half + 1 / (complex(R, X) + 1 / half)
    return 100 * y.real, 100 * y.imag


def without(line, bus, y):
    """Return the case without a line, with an admittance in its place."""
    kept = [one for one in SPUR.splitlines() if not one.startswith(f"lines.{line} ")]
    shunt = f'shunts.open = {{ bus = "{bus}", g = "{y[0]!r} MW", b = "{y[1]!r} Mvar" }}'
    return "\n".join(kept).replace("[components.sg]", f"{shunt}\n[components.sg]")


@pytest.mark.parametrize(("opened", "charged"), [("b3", "b1"), ("b1", "b3")])
def test_an_open_end_leaves_the_lines_charging_at_the_other(opened, charged, tmp_path):
    found = critical(case_of(tmp_path), f"l31 at {opened}")
    (tmp_path / "own").mkdir()
    by_hand = without("l31", charged, charging(0.03, 0.003, 0.4))
    expected = critical(case_of(tmp_path / "own", by_hand))
    assert len(found) == len(expected) >= 1
    assert found == pytest.approx(expected, rel=OPENING)
    whole = critical(case_of(tmp_path), "l31")  # lost at both ends, it is something else
    assert abs(found - whole).max() > 5 * OPENING * abs(whole).max()


@pytest.mark.parametrize(("opened", "charged"), [("b4", True), ("b3", False)])
def test_what_hangs_on_the_end_is_lost_and_the_line_is_charged_from_what_remains(
    opened, charged, tmp_path
):
    found = critical(case_of(tmp_path), f"l34 at {opened}")
    (tmp_path / "own").mkdir()
    spur = charging(0.04, 0.004, 0.8) if charged else (0.0, 1e-9)
    by_hand = without("l34", "b3", spur).replace(FARM, "").replace(', "b4"]', "]")
    expected = critical(case_of(tmp_path / "own", by_hand))
    # a line that is dead keeps a thousandth of its charging as well
    assert found == pytest.approx(expected, rel=10 * OPENING)


def test_ends_are_outages_beside_others_and_parts_of_double_ones(tmp_path):
    found = case_of(tmp_path).screen(outages="l12,l31 at b3,l12+l34 at b4", sharing="slack")
    names = [item.outage.name for item in found.result.items]
    assert names == ["intact", "l12", "l31 at b3", "l12+l34 at b4"]
    assert {str(item.record.status) for item in found.result.items} == {"computed"}


def test_in_a_run_the_end_opens_after_a_fault_at_its_own_bus(tmp_path, monkeypatch):
    seen = []
    run = outage_runs._outage_run
    monkeypatch.setattr(outage_runs, "_outage_run", lambda ready: seen.append(ready) or run(ready))
    screening = case_of(tmp_path).screen(
        outages="l31 at b1", sharing="slack", trips="0.5 s", cleared_after="50 ms"
    )
    fault, cleared, opening = seen[0].events
    assert (fault.bus, cleared.on) == ("b1", False)
    assert (opening.line, opening.end, opening.connected) == ("l31", "to", False)
    assert screening.result.items[-1].record.run.went_wrong == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("l31 at b2", "l31 joins b3 and b1; write 'l31 at b3' or 'l31 at b1'"),
        ("l13 at b3", "there is no unit, line, DC line, load or shunt 'l13 at b3'"),
        ("town at b3", "there is no unit, line, DC line, load or shunt 'town at b3'"),
        ("l31 at b3,l31 at b3", "l31 at b3 is named twice"),
    ],
)
def test_an_end_that_is_none_is_refused(text, words, tmp_path):
    with pytest.raises(InputError, match=words):
        case_of(tmp_path).screen(outages=text)


def test_a_network_with_transients_is_refused_and_its_remedy_works(tmp_path):
    emt = SPUR.replace('models = "phasor"\n', "").replace("1 ms", "100 us")
    case = case_of(tmp_path, emt)
    with pytest.raises(InputError, match=r"has transients; give .*models=phasor"):
        case.screen(outages="l31 at b3")
    found = case.screen(outages="l31 at b3", values={"models": "phasor"}, sharing="slack")
    assert found.result.items[-1].record.status == "computed"
