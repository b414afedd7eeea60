"""REXSYS: the exciters that it encompasses, its whole diagram step by step, its ceilings and its records."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.core.errors import InputError
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import AT_REST, E_FD, V_T, exciter, integrated, refused

REST = AT_REST["exciter"]
ALTERNATOR = {"K_E": 0.9, "T_E": 0.6, "K_C": 0.15, "K_D": 0.4, "T_R": 0.015}
CURVE = {"E_1": 3.0, "S_E1": 0.05, "E_2": 4.0, "S_E2": 0.3}
FEEDBACK = {"K_F": 0.04, "T_F": 0.9}
COMMON = ALTERNATOR | CURVE | FEEDBACK

ENCOMPASSED = {
    "ac1a": (
        COMMON | {"K_A": 200.0, "T_A": 0.03, "T_C": 0.8, "T_B": 6.0},
        COMMON | {"K_VP": 200.0, "T_A": 0.03, "T_C1": 0.8, "T_B1": 6.0},
    ),
    "exac2": (
        COMMON
        | {"K_A": 120.0, "T_A": 0.02, "T_C": 0.0, "T_B": 0.0, "K_B": 8.0, "K_H": 0.7}
        | {"K_L": 1e3, "V_LR": 1e3, "V_AMAX": 99.0, "V_RMAX": 99.0},
        COMMON | {"K_VP": 120.0, "T_A": 0.02, "K_IP": 8.0, "K_H": 0.7},
    ),
    "dc1a": (
        CURVE | FEEDBACK | {"K_A": 60.0, "T_A": 0.1, "K_E": 0.9, "V_RMAX": 99.0},
        COMMON
        | {"K_VP": 60.0, "T_A": 0.1, "K_C": 0.0, "K_D": 0.0, "F_BF": 2.0, "T_R": 0.01}
        | {"T_E": 0.314},
    ),
    "exbas": (
        COMMON
        | {"K_A": 1.0, "K_PR": 90.0, "K_IR": 40.0, "T_A": 0.05, "T_F1": 0.3, "T_F2": 0.08}
        | {"V_RMAX": 99.0},
        COMMON | {"K_VP": 90.0, "K_VI": 40.0, "T_A": 0.05, "F_BF": 0.0, "T_F1": 0.3, "T_F2": 0.08},
    ),
}
"""Values of an exciter, and those for which REXSYS is the same."""


@pytest.mark.parametrize("name", ENCOMPASSED)
def test_it_is_the_exciters_that_it_encompasses(name):
    """AC1A's part is held against PSS/E's recordings."""
    theirs, ours = ENCOMPASSED[name]
    other, own = exciter(name, theirs), exciter("rexsys", ours)
    assert not refused(own)
    assert max(map(abs, own.rates(REST).values())) < 1e-9
    for hertz in (0.05, 0.7, 7.0):
        wanted = other.response(2j * np.pi * hertz, REST)
        found = own.response(2j * np.pi * hertz, REST)
        for u in ("v_t", "v_s", "I_fd"):
            assert found["E_fd", u] == pytest.approx(wanted["E_fd", u], rel=1e-6)


WHOLE = COMMON | {
    "K_VP": 8.0,
    "K_VI": 13.0,
    "V_IMAX": 0.4,
    "T_A": 0.04,
    "T_C1": 0.3,
    "T_B1": 0.7,
    "T_C2": 0.1,
    "T_B2": 0.05,
    "V_RMAX": 3.2,
    "V_RMIN": 1.0,
    "T_F1": 0.2,
    "T_F2": 0.1,
    "K_IP": 3.0,
    "K_II": 4.0,
    "T_P": 0.02,
    "V_FMAX": 3.3,
    "V_FMIN": 1.8,
    "K_H": 1.0,
    "F_1IMF": 1.0,
}
"""Every block takes part; the regulators have integrals."""

QUICK, END = 2e-4, 1.6  # step and end of the diagram's integration [s]


def inputs(t):
    """Terminal voltage, field current and stabiliser's signal: a dip, a step up and one down, each into limits."""
    v_t = 0.6 if 0.1 <= t < 0.3 else V_T
    v_s = 0.5 if 0.3 <= t < 0.6 else -0.9
    return [v_t, E_FD + (0.5 if t >= 0.2 else 0.0), v_s if 0.3 <= t < 1.2 else 0.0]


def within(x, low, high):
    return min(max(x, low), high)


@dataclass
class Diagram:
    """The block diagram with ideal limits, integrated by Euler; it starts where the part's states start."""

    p: dict
    x: dict
    V_ref: float
    found: dict = field(default_factory=dict)

    def step(self, v_t, I_fd, v_s, h):
        p, x = self.p, self.x
        V_E = x["V_E"]
        S = SLOPE * max(V_E - ZERO, 0.0) ** 2 / V_E
        V_FE = (p["K_E"] + S) * V_E + p["K_D"] * I_fd
        F = (1 + p["F_1IMF"] * (v_t - 1)) * (p["K_E"] + p["K_D"] + S)
        V_R = within(x["amplifier"], F * p["V_RMIN"], F * p["V_RMAX"])
        fast = p["K_F"] / p["T_F"] * (V_FE - x["feedback"])
        V_F = x["feedback_2"] + p["T_F1"] / p["T_F2"] * (fast - x["feedback_2"])
        error = within(self.V_ref + v_s - x["v_m"] - V_F, -p["V_IMAX"], p["V_IMAX"])
        u = p["K_VP"] * error + x["regulator"]
        first = x["lead_lag1"] + p["T_C1"] / p["T_B1"] * (u - x["lead_lag1"])
        second = x["lead_lag2"] + p["T_C2"] / p["T_B2"] * (first - x["lead_lag2"])
        rest = V_R - p["K_H"] * V_FE
        driven = p["K_IP"] * rest + x["field_regulator"]
        V_C = within(x["bridge"], F * p["V_FMIN"], F * p["V_FMAX"])
        rates = {
            "v_m": (v_t - x["v_m"]) / p["T_R"],
            "feedback": (V_FE - x["feedback"]) / p["T_F"],
            "feedback_2": (fast - x["feedback_2"]) / p["T_F2"],
            "regulator": p["K_VI"] * error,
            "lead_lag1": (u - x["lead_lag1"]) / p["T_B1"],
            "lead_lag2": (first - x["lead_lag2"]) / p["T_B2"],
            "amplifier": (second - V_R) / p["T_A"],
            "field_regulator": p["K_II"] * rest,
            "bridge": (driven - V_C) / p["T_P"],
            "V_E": (V_C - V_FE) / p["T_E"],
        }
        x.update(amplifier=V_R, bridge=V_C)
        for name, rate in rates.items():
            x[name] += h * rate
        x["V_E"] = max(x["V_E"], 1e-9)
        self.reached(F, V_R, V_C, error)
        loading = p["K_C"] * I_fd / x["V_E"]
        return x["V_E"] * F_EX(loading)

    def reached(self, F, V_R, V_C, error):
        """Note which limits have held."""
        p = self.p
        at = {
            "V_RMAX": F * p["V_RMAX"] <= V_R,
            "V_RMIN": F * p["V_RMIN"] >= V_R,
            "V_FMAX": F * p["V_FMAX"] <= V_C,
            "V_FMIN": F * p["V_FMIN"] >= V_C,
            "V_IMAX": abs(error) >= p["V_IMAX"],
        }
        self.found |= {name: True for name, holds in at.items() if holds}


def F_EX(I_N):
    if I_N <= 0.433:
        return 1 - 0.577 * I_N
    return np.sqrt(max(0.75 - I_N**2, 0)) if I_N < 0.75 else max(1.732 * (1 - I_N), 0)


RATIO = np.sqrt(3.0 * 0.05 / (4.0 * 0.3))
ZERO = (3.0 - RATIO * 4.0) / (1 - RATIO)
SLOPE = 4.0 * 0.3 / (4.0 - ZERO) ** 2
"""Saturation through CURVE's points: S_E(E)·E = SLOPE·(E − ZERO)²."""


@pytest.mark.parametrize("changed", [{}, {"F_1IMF": 0.0, "K_H": 0.8}], ids=["supply", "steady"])
def test_it_follows_its_diagram_step_by_step(changed):
    """In the dip limits that follow the supply pass states, which return in milliseconds, ideally at once: 0.6 %."""
    p = WHOLE | changed
    own, every = exciter("rexsys", p), 5
    assert not refused(own)
    x = {name.removeprefix("exciter."): value for name, value in own.states.items()}
    diagram = Diagram(p, x, own.parameters["exciter.V_ref"])
    wanted = []
    for k in range(round(END / QUICK)):
        E_fd = diagram.step(*inputs(k * QUICK), QUICK)
        if k % every == every - 1:
            wanted.append(E_fd)
    found = [each["E_fd"] for each in integrated(own, inputs, END, QUICK * every)[0]]
    assert diagram.found.keys() == {"V_FMAX", "V_FMIN", "V_RMAX", "V_RMIN", "V_IMAX"}
    assert np.ptp(wanted) > 0.7
    assert np.abs(np.array(found) - wanted).max() < 0.01 * np.ptp(wanted)


NO_LOAD = {"K_E": 0.0, "K_D": 0.0, "S_E1": 0.0, "S_E2": 0.0}


@pytest.mark.parametrize(("share", "v_t"), [(0.0, 0.7), (1.0, 0.7), (0.5, 1.2)])
def test_its_ceilings_follow_the_terminal_voltage_by_their_share(share, v_t):
    """Without saturation and rectifier F is 1 + F_1IMF·(v_t − 1), and E_fd ends at the exciter's field."""
    plain = NO_LOAD | {"K_E": 1.0, "K_C": 0.0, "T_E": 0.05}
    for limit in ("V_RMAX", "V_FMAX"):
        own = exciter("rexsys", plain | {limit: 4.0, "F_1IMF": share})
        found, _ = integrated(own, lambda t: [v_t, E_FD, 0.8], 0.5)
        assert found[-1]["E_fd"] == pytest.approx(4.0 * (1 + share * (v_t - 1)), rel=1e-3)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"K_VP": 0.0}, "exciter: one of K_VP and K_VI must exceed 0"),
        ({"K_IP": 0.0}, "exciter: one of K_IP and K_II must exceed 0"),
        ({"F_BF": 0.0, "T_A": 0.0}, "exciter.F_BF = 0 with exciter.K_F > 0 needs exciter.T_A > 0"),
        ({"T_F1": 0.1}, "exciter.T_F2 = 0 needs exciter.T_F1 = 0 as well"),
        ({"V_RMAX": 2.0}, "exciter.V_RMAX"),
        ({"V_FMAX": 2.0}, "exciter.V_FMAX"),
        ({"K_VP": 1.0, "V_IMAX": 0.5}, "exciter.V_IMAX"),
        (NO_LOAD, "exciter: K_E + K_D + S_E must exceed 0 at the start"),
        ({"T_F": 0.0, "K_F": 0.1}, "exciter.T_F must be above 0"),
    ],
)
def test_what_cannot_be_is_refused_by_its_name(values, said):
    assert any(text.startswith(said) for text in refused(exciter("rexsys", values)))


def test_its_integrals_carry_the_operating_point():
    """With both no error is left, and the reference is the measured voltage."""
    own = exciter("rexsys", WHOLE)
    assert max(map(abs, own.rates(REST).values())) < 1e-9
    assert own.parameters["exciter.V_ref"] == pytest.approx(V_T, abs=1e-12)


def test_without_integrals_no_state_is_undecided():
    A = np.array(exciter("rexsys").blocks(REST)[0], dtype=float)
    assert np.linalg.eigvals(A).real.max() < -0.01


FIELDS = (
    "0.028 350 2 0.9 0.02 6 1 0.2 0.1 101 -102 0.05 2 0.3 0.1 2 1.5 0.5 0.03 99 -98 0.1 1.1 0.55 "
    "0.2 0.3 3.06 0.1 4.08 0.4 0.7"
)
IN_ORDER = (
    "T_R K_VP K_VI V_IMAX T_A T_B1 T_C1 T_B2 T_C2 V_RMAX V_RMIN K_F T_F T_F1 T_F2 F_BF K_IP K_II T_P V_FMAX V_FMIN K_H "
    "K_E T_E K_C K_D E_1 S_E1 E_2 S_E2 F_1IMF"
)
"""As PowerWorld's help lists them, as InterPSS and a reader on PETSc read them, and OpenIPSL's script gives them to
PSS/E."""
GENROU = "1 'GENROU' 1 8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /\n"


def model_of(tmp_path, record):
    place = tmp_path / "one.dyr"
    place.write_text(GENROU + record)
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    return machine_models(read_dyr(place), [machine])[1, "1"]


@pytest.mark.parametrize(("name", "more"), [("REXSYS", ""), ("REXSY1", " 0 0.4")])
def test_its_records_have_their_fields_in_order(name, more, tmp_path):
    model = model_of(tmp_path, f"1 '{name}' 1 {FIELDS}{more} /\n")
    wanted = dict(zip(IN_ORDER.split(), map(float, FIELDS.split()), strict=True))
    own = {n: v for n, v in model.parameters.items() if n.startswith("exciter.")}
    assert model.parts["exciter"] == "rexsys"
    assert own == {f"exciter.{n}": v for n, v in wanted.items()}


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (f"1 'REXSY1' 1 {FIELDS} 0.2 0.4 /\n", "XC"),
        (f"1 'REXSYS' 1 {FIELDS.replace(' 2 1.5 ', ' 3 1.5 ')} /\n", "FBF"),
    ],
)
def test_what_a_record_has_that_no_source_explains_is_refused_by_its_field(record, said, tmp_path):
    with pytest.raises(InputError, match=said):
        model_of(tmp_path, record)


def test_a_machine_with_it_damps_as_with_exac1(tmp_path):
    """Fields of EXAC1, whose part is held against PSS/E's recordings, and those that make REXSYS the same."""
    start = "102 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /\n102 "
    exac1 = "'EXAC1' 1 0.01 2 0.5 200 0.02 99 -99 0.8 0.03 1 0.2 0.38 1 3.14 0.03 4.18 0.1 /\n"
    rexsys = (
        "'REXSYS' 1 0.01 200 0 99 0.02 2 0.5 0 0 99 -99 0.03 1 0 0 1 1 0 0 999 -999 0 1 0.8 0.2 0.38 3.14 0.03 4.18 "
        "0.1 0 /\n"
    )
    network, _ = three_buses()
    found = [OneMachine(start + x, tmp_path, network).eigenvalues() for x in (exac1, rexsys)]
    for wanted in (x for x in found[0] if abs(x) < 1e3):
        assert np.abs(found[1] - wanted).min() < 1e-4 * max(abs(wanted), 1)
