"""Taps and switched shunts of a RAW file move after an outage until voltages are in their bands, if asked for."""

import cmath
import math

import numpy as np
import pytest
from scipy.optimize import fsolve

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError, InputError
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.screening.view import as_json
from tests.cases.networks.psse import ORDER, raw

CASE = """\
name = "radial"
models = "phasor"
[power_flow]
grid = "grid"
slack = "bus_1"
[components.grid]
model = "grid"
[network]
raw = "radial.raw"
load_model = { active = "power", reactive = "power" }
stray_B = 0.0
[units]
file = "units.csv"
generator = "synchronous_generator"
converter = "gfor"
alpha = 0.0
[scenarios.base]
"""
R, X = 0.01, 0.10  # of each of two lines from bus 1 to bus 2 [pu, 100 MVA]
X_T, X_FAR = 0.08, 0.20  # of the transformer from bus 2 to bus 3, and of the line from 2 to 4
LOADS = {3: (60.0, 30.0), 4: (30.0, 20.0)}  # [MW, Mvar]
BLOCK, BLOCKS = 5.0, 6  # of the shunt at bus 4 [Mvar]
STEP = 0.2 / 32  # of a tap from 0.9 to 1.1 with 33 positions
BANDS = {3: (0.98, 1.02), 4: (0.93, 1.02)}


def independent(lines, tap, mvar):
    """Voltages of buses 1 to 4 by SciPy from the network's own data, for a number of lines from 1 to 2."""
    y = np.zeros((4, 4), dtype=complex)
    for i, j, z, ratio in (
        (0, 1, complex(R, X) / lines, 1.0),
        (1, 2, 1j * X_T, tap),
        (1, 3, 1j * X_FAR, 1.0),
    ):
        y[i, i] += 1 / z / ratio**2
        y[j, j] += 1 / z
        y[i, j] -= 1 / z / ratio
        y[j, i] -= 1 / z / ratio
    y[3, 3] += 1j * mvar / 100

    def voltages(x):
        return np.array([1.02, *(x[:3] * np.exp(1j * x[3:]))])

    def missing(x):
        s = voltages(x) * (y @ voltages(x)).conj()
        for bus, (p, q) in LOADS.items():
            s[bus - 1] += complex(p, q) / 100
        return [*s.real[1:], *s.imag[1:]]

    solution, _, found, text = fsolve(missing, [1.0] * 3 + [0.0] * 3, full_output=True, xtol=1e-13)
    assert found == 1, text
    return voltages(solution)


def by_hand():
    """Tap and shunt after the outage: each moves by one position while its bus is below its band."""
    tap, mvar = 1.0, 0.0
    while True:
        v = independent(1, tap, mvar)
        low = [abs(v[bus - 1]) < BANDS[bus][0] for bus in (3, 4)]
        if not any(low):
            return tap, mvar
        tap -= STEP * low[0]
        mvar += BLOCK * low[1]


@pytest.fixture
def folder(tmp_path):
    found = {section: [] for section in ORDER}
    start = independent(2, 1.0, 0.0)
    found["BUS"] = [
        f"{k + 1},'B{k + 1}',132.0,{3 if k == 0 else 1},1,1,1,{abs(v):.15g},"
        f"{math.degrees(cmath.phase(v)):.15g},1.1,0.9,1.1,0.9"
        for k, v in enumerate(start)
    ]
    found["LOAD"] = [f"{n},'1 ',1,1,1,{p},{q},0,0,0,0,1,1,0" for n, (p, q) in LOADS.items()]
    found["GENERATOR"] = ["1,'1 ',92,0,300,-300,1.02,0,250,0,0.2,0,0,1,1,100,250,0,1,1"]
    lines = ((1, 2, 1, R, X), (1, 2, 2, R, X), (2, 4, 1, 0.0, X_FAR))
    found["BRANCH"] = [
        f"{i},{j},'{c} ',{r},{x},0.0,0,0,0,0,0,0,0,1,1,0,1,1" for i, j, c, r, x in lines
    ]
    low, high = BANDS[3]
    found["TRANSFORMER"] = [
        "2,3,0,'1 ',1,1,1,0,0,2,'T',1,1,1",
        f"0,{X_T},100",
        f"1.0,0,0,0,0,0,1,3,1.1,0.9,{high},{low},33,0,0,0,0",
        "1.0,0",
    ]
    low, high = BANDS[4]
    found["SWITCHED SHUNT"] = [f"4,1,0,1,{high},{low},0,100,'',0.0,{BLOCKS},{BLOCK}"]
    (tmp_path / "radial.raw").write_text(raw(33, found))
    (tmp_path / "units.csv").write_text("bus,v_pu,rating_mva,p_mw\n1,1.02,250,92\n")
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


OUT = Item(0, 1, {}, ("line_1_2_2",), ("line_1_2_2",))


def after_outage(folder, *, moves):
    case = load_case(folder / "case.toml")
    return ItemPreparation(case, "base", (), move_controls=moves).prepared(OUT)


def test_controls_are_held_unless_asked_for(folder):
    flow = after_outage(folder, moves=False).scenario.power_flow
    wanted = independent(1, 1.0, 0.0)
    assert [flow.voltages[f"bus_{k + 1}"] for k in range(4)] == pytest.approx(wanted, abs=1e-6)
    assert abs(wanted[2]) < BANDS[3][0]
    assert abs(wanted[3]) < BANDS[4][0]


def test_controls_move_until_voltages_are_in_their_bands(folder):
    tap, mvar = by_hand()
    assert tap < 1 - STEP
    assert mvar >= BLOCK
    found = after_outage(folder, moves=True)
    grid = found.scenario.system.components["grid"]
    assert grid.number("tap_line_2_3") == pytest.approx(tap, abs=1e-12)
    assert grid.number("shunt_4.B") == pytest.approx(mvar, abs=2e-6)
    flow, wanted = found.scenario.power_flow, independent(1, tap, mvar)
    assert [flow.voltages[f"bus_{k + 1}"] for k in range(4)] == pytest.approx(wanted, abs=1e-6)
    for bus, (low, high) in BANDS.items():
        assert low <= abs(flow.voltages[f"bus_{bus}"]) <= high
    assert f"tap_line_2_3 1 to {tap:.4g}" in found.text
    assert f"shunt_4.B 0 to {mvar:.4g}" in found.text


def test_the_intact_network_stays_as_the_file_has_it(folder):
    case = load_case(folder / "case.toml")
    preparation = ItemPreparation(case, "base", (), move_controls=True)
    flow = preparation.prepared(Item(0, 0, {}, ())).scenario.power_flow
    wanted = independent(2, 1.0, 0.0)
    assert [flow.voltages[f"bus_{k + 1}"] for k in range(4)] == pytest.approx(wanted, abs=1e-6)


def test_the_key_and_values_of_the_command_line_do_the_same(folder):
    text = CASE.replace("stray_B = 0.0", "stray_B = 0.0\nmove_controls = true")
    (folder / "case.toml").write_text(text)
    case = load_case(folder / "case.toml")
    tap, _ = by_hand()
    off = {"grid.line_1_2_2.connected": False}
    (found,) = case.prepare(["base"], off)
    assert found.system.components["grid"].number("tap_line_2_3") == pytest.approx(tap)
    (given,) = case.prepare(["base"], off | {"grid.tap_line_2_3": 0.975})
    assert given.system.components["grid"].number("tap_line_2_3") == 0.975
    live = ItemPreparation(case, "base", ()).live(OUT)
    (again,) = case.prepare(["base"], live)
    for bus, voltage in found.power_flow.voltages.items():
        assert abs(again.power_flow.voltages[bus] - voltage) < 1e-9


def test_a_screening_says_which(folder, tmp_path):
    scenario = gfor.load(folder / "case.toml")
    kept = scenario.screen(outages=["line_1_2_2"], folder=tmp_path / "held")
    moved = scenario.screen(outages=["line_1_2_2"], move_controls=True, folder=tmp_path / "moved")
    said = [str(as_json(found.summary)["controls"]) for found in (kept, moved)]
    assert said[0] == (
        "after outages 1 tap and 1 switched shunt are held; --move-controls lets them move"
    )
    assert said[1] == (
        "after outages 1 tap and 1 switched shunt move until voltages are in their bands"
    )


def test_networks_that_have_none_are_refused(folder):
    with pytest.raises(InputError, match=r"move_controls .--move-controls. is for networks of PSS"):
        ItemPreparation(load_case("two_area"), "base", (), move_controls=True)
    text = CASE.replace("stray_B = 0.0", "move_controls = true").replace('"phasor"', '"emt"')
    (folder / "case.toml").write_text(text)
    with pytest.raises(CaseError, match="taps and shunts move in phasor models"):
        load_case(folder / "case.toml").prepare(["base"])
