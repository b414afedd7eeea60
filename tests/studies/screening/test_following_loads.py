"""Loads of constant current and impedance follow the voltage of an outage's power flow, as the RAW file means them."""

import cmath

import numpy as np
import pytest
from scipy.optimize import fsolve

from orchestrator.cases.case import load_case
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.preparation import ItemPreparation
from tests.cases.networks.psse import LINES, LOADS, MACHINES, TRANSFORMERS, raw, records

CASE = """\
name = "wscc"
[power_flow]
grid = "grid"
slack = "bus_1"
[components.grid]
model = "phasor_grid"
[network]
raw = "wscc.raw"
{keys}
load_model = {{ active = "power", reactive = "power" }}
stray_B = 0.0
[units]
file = "units.csv"
generator = "synchronous_generator_phasor"
converter = "gfor_phasor"
alpha = 0.0
[scenarios.base]
"""
# at bus 5 besides [MW, Mvar at 1 pu]: constant current, constant admittance (YQ > 0 generates)
CURRENT = 40 + 20j
IMPEDANCE = 30 + 10j
LOST = (5, 7)
"""Ends of the line that is lost. Here it has no charging: the product lets an open line keep a little of it."""


def independent_voltages(lost=None):
    """Magnitudes and angles of the nine buses by SciPy from the network's own data, on 100 MVA."""
    admittance = np.zeros((9, 9), dtype=complex)
    for i, j, r, x, charging in LINES:
        b = 0.0 if (i, j) == LOST else charging
        if (i, j) != lost:
            y = 1 / complex(r, x)
            admittance[i - 1, i - 1] += y + 0.5j * b
            admittance[j - 1, j - 1] += y + 0.5j * b
            admittance[i - 1, j - 1] -= y
            admittance[j - 1, i - 1] -= y
    for i, j, x in TRANSFORMERS:
        y = 1 / complex(0, x)
        admittance[[i - 1, j - 1], [i - 1, j - 1]] += y
        admittance[[i - 1, j - 1], [j - 1, i - 1]] -= y
    held = {n: v for n, (_, v, _) in MACHINES.items()}
    fed = {n: p / 100 for n, (p, _, _) in MACHINES.items()}

    def voltages(x):
        v = np.array([held.get(n, 1.0) for n in range(1, 10)], dtype=complex)
        v[3:] = x[8:]
        return v * np.exp(1j * np.array([0.0, *x[:8]]))

    def missing(x):
        v = voltages(x)
        s = v * (admittance @ v).conj()
        for n, p in fed.items():
            s[n - 1] -= p
        for n, (p, q) in LOADS.items():
            s[n - 1] += complex(p, q) / 100
        magnitude = abs(v[4])
        s[4] += (CURRENT * magnitude + IMPEDANCE * magnitude**2) / 100
        return [*s.real[1:], *s.imag[3:]]

    solution, _, found, text = fsolve(missing, [0.0] * 8 + [1.0] * 6, full_output=True, xtol=1e-13)
    assert found == 1, text
    return voltages(solution)


@pytest.fixture
def prepared(tmp_path):
    """A way to prepare the system with a line out, the file's parts of loads kept or not."""

    def prepare(keys="keep_load_parts = true"):
        found = records(33)
        p, q = LOADS[5]
        parts = f"{CURRENT.real},{CURRENT.imag},{IMPEDANCE.real},{-IMPEDANCE.imag}"
        found["LOAD"][0] = f"5,'1 ',1,1,1,{p},{q},{parts},1,1,0"
        lost = next(k for k, (i, j, *_) in enumerate(LINES) if (i, j) == LOST)
        charging = f",{LINES[lost][4]},"
        found["BRANCH"][lost] = found["BRANCH"][lost].replace(charging, ",0.0,", 1)
        solved = independent_voltages()
        for k, v in enumerate(solved):
            fields = found["BUS"][k].split(",")
            fields[7:9] = [f"{abs(v):.15g}", f"{np.degrees(cmath.phase(v)):.15g}"]
            found["BUS"][k] = ",".join(fields)
        (tmp_path / "wscc.raw").write_text(raw(33, found))
        units = [f"{n},{v},{base},{p}" for n, (p, v, base) in MACHINES.items()]
        (tmp_path / "units.csv").write_text("\n".join(["bus,v_pu,rating_mva,p_mw", *units]))
        (tmp_path / "case.toml").write_text(CASE.format(keys=keys))
        case = load_case(tmp_path / "case.toml")
        preparation = ItemPreparation(case, next(iter(case.scenarios)), ())
        line = next(name for name in preparation.elements.lines if name.startswith("line_5_7"))
        item = Item(0, 1, {}, (line,), (line,))
        return preparation, item

    return prepare


def differences(scenario, wanted):
    voltages = scenario.power_flow.voltages
    return [abs(voltages[f"bus_{n}"] - wanted[n - 1]) for n in range(1, 10)]


def test_voltages_after_an_outage_are_those_of_an_independent_solution(prepared):
    preparation, item = prepared()
    assert max(differences(preparation.base, independent_voltages())) < 1e-8
    assert max(differences(preparation.prepared(item).scenario, independent_voltages(LOST))) < 1e-8


def test_the_load_is_set_to_what_it_draws_then(prepared):
    preparation, item = prepared()
    scenario = preparation.prepared(item).scenario
    v = abs(independent_voltages(LOST)[4])
    drawn = complex(*LOADS[5]) + CURRENT * v + IMPEDANCE * v**2
    grid = scenario.system.components["grid"]
    assert complex(grid.number("load_5.P"), grid.number("load_5.Q")) == pytest.approx(
        drawn, abs=1e-5
    )


def typed(preparation, values):
    """The case with values as `gfor modes --set` gives them."""
    (found,) = preparation._case.prepare([preparation._scenario], values)
    return found


def test_the_same_outage_by_set_is_the_one_of_a_screening(prepared):
    preparation, item = prepared()
    off = {f"grid.{item.lost[0]}.connected": False}
    assert max(differences(typed(preparation, off), independent_voltages(LOST))) < 1e-8
    powers = {
        f"{name}.P_0": power.real for name, power in preparation.base.power_flow.powers.items()
    }
    with_powers = typed(preparation, off | powers)
    assert max(differences(with_powers, independent_voltages(LOST))) < 1e-8


def test_a_load_whose_power_is_given_draws_that_after_an_outage(prepared):
    preparation, item = prepared()
    off = {f"grid.{item.lost[0]}.connected": False, "grid.load_5.P": 160.0}
    grid = typed(preparation, off).system.components["grid"]
    assert grid.number("load_5.P") == 160.0


def test_what_a_screening_names_to_see_an_item_again_is_the_item_as_it_is_typed(prepared):
    preparation, item = prepared()
    alone = typed(preparation, preparation.live(item))
    assert max(differences(alone, independent_voltages(LOST))) < 1e-8


def test_the_case_alone_is_at_the_item_by_its_values(prepared):
    """What `gfor screen` names as the way to see an item again."""
    preparation, item = prepared()
    alone = preparation._prepare(preparation.live(item))
    assert max(differences(alone, independent_voltages(LOST))) < 1e-8


def test_without_parts_all_powers_stay_as_given(prepared):
    preparation, item = prepared("")
    grid = preparation.prepared(item).scenario.system.components["grid"]
    assert grid.parameters.get("load_5.P") == preparation.base.system.components[
        "grid"
    ].parameters.get("load_5.P")
