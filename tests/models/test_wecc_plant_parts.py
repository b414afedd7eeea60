"""Plants of REGCB1, REGCC1, REECC1, REECD1 and of a wind turbine's records, against their equations by hand."""

import numpy as np
import pytest

from fmus.wecc_renewable.composed import wecc_plant_phasor
from tests.models.closed import AtSource
from tests.models.parts import refused
from tests.models.plant_parts_by_hand import Hand
from tests.support.evaluated import Evaluated

Z_NETWORK = 0.03 + 0.25j
FLOW = 0.6, 0.12, 1.01  # P, Q and |v| [pu]
SCOPES = {
    "REGC": "",
    "REEC": "electrical.",
    "WTDTA1": "shaft.",
    "WTARA1": "aerodynamics.",
    "WTPTA1": "pitch.",
    "WTTQA1": "torque.",
}

CONTROL = {"PFFLAG": 0, "VFLAG": 0, "QFLAG": 1, "PQFLAG": 0, "Trv": 0.02, "Kqv": 0.7, "Kvp": 1.5}
CONTROL |= {"Kvi": 25.0, "Kqp": 0.1, "Kqi": 0.4, "Tiq": 0.03, "Tpord": 0.04, "VMAX": 1.2}
CONTROL |= {"VMIN": 0.7, "QMax": 0.8, "QMin": -0.8, "Imax": 1.3}
STORAGE = CONTROL | {"T": 50.0, "SOCini": 0.5}
TYPE_D = CONTROL | {"VCMPFLAG": 1, "Rc": 0.01, "Xc": 0.08, "Tr1": 0.03, "Kc": 0.05, "Ke": 0.4}
BEHIND = {"RateFlag": 0, "PQFLAG": 1, "Tg": 0.02, "Tfltr": 0.015, "Te": 0.01, "Imax": 1.3}
BEHIND |= {"Re": 0.004, "Xe": 0.18}
LOOP = BEHIND | {"Kip": 0.5, "Kii": 20.0, "Kppll": 20.0, "Kipll": 200.0}
WIND = {
    "WTDTA1": {"H": 4.5, "DAMP": 0.3, "Htfrac": 0.85, "Freq1": 1.6, "Dshaft": 1.4},
    "WTARA1": {"Ka": 0.007, "Theta0": 6.0},
    "WTPTA1": {"Kiw": 25.0, "Kpw": 120.0, "Kic": 0.0, "Kpc": 0.0, "Kcc": 0.1, "Tp": 0.3},
    "WTTQA1": {"Tflag": 0, "Kpp": 3.0, "Kip": 0.6, "Tp": 0.06, "Twref": 20.0}
    | {"P1": 0.2, "Spd1": 0.6, "P2": 0.4, "Spd2": 0.74, "P3": 0.55, "Spd3": 0.9}
    | {"P4": 0.8, "Spd4": 1.05},
}
CURRENT = {"Tg": 0.02}
PLANTS = {
    "behind an impedance, battery": {"REGCB1": BEHIND, "REECC1": STORAGE},
    "its rate is of power, Q control": {
        "REGCB1": BEHIND | {"RateFlag": 1},
        "REECC1": STORAGE | {"QFLAG": 0},
    },
    "behind an impedance, D with Rc and Xc": {"REGCB1": BEHIND, "REECD1": TYPE_D},
    "D with Kc within Q control": {
        "REGCA1": CURRENT,
        "REECD1": TYPE_D | {"VCMPFLAG": 0, "VFLAG": 1},
    },
    "current loop and PLL": {"REGCC1": LOOP, "REECC1": STORAGE},
    "current loop, D": {"REGCC1": LOOP | {"RateFlag": 1}, "REECD1": TYPE_D},
    "wind, torque by speed": {"REGCA1": CURRENT, "REECA1": CONTROL | {"Kqv": 0.0}, **WIND},
    "wind, torque by power": {
        "REGCA1": CURRENT,
        "REECA1": CONTROL | {"Kqv": 0.0},
        **WIND,
        "WTTQA1": WIND["WTTQA1"] | {"Tflag": 1},
    },
}
"""Values by record and field."""


def parameters(values):
    """Our parameters of a plant's records."""
    found = {}
    for record, fields in values.items():
        scope = next(scope for start, scope in SCOPES.items() if record.startswith(start))
        found |= {f"{scope}{name}": value for name, value in fields.items()}
    return found


def modelled(values, **more):
    """Our model of the records at the operating point, with a short lag of the bus voltage."""
    P, Q, v = FLOW
    hand = Hand(values, FLOW, Z_NETWORK)
    given = {"P_0": P, "Q_0": Q, "v_0": v, "theta_0": hand.frame_0, "f_n": 60.0}
    own = parameters(values) | given | {"bus_voltage.tau": 1e-3} | more
    return Evaluated(wecc_plant_phasor(" ".join(values)), own), hand


@pytest.mark.parametrize("name", PLANTS)
def test_it_rests_at_the_operating_point(name):
    device, hand = modelled(PLANTS[name])
    assert not refused(device)
    P, Q, v = FLOW
    bus = v * np.exp(1j * hand.frame_0)
    outputs = device.outputs([bus.real, bus.imag])
    assert (outputs["p"], outputs["q"]) == pytest.approx((P, Q), abs=1e-12)
    assert max(map(abs, device.rates([bus.real, bus.imag]).values())) < 1e-9
    assert max(map(abs, hand.rates(hand.x).values())) < 1e-11
    assert abs(AtSource(device, Z_NETWORK).voltage(device.x, hand.source) - bus) < 1e-12


SLOW, FAST = 1e-3, 60.0  # eigenvalues [1/s] between which both are compared


@pytest.mark.parametrize("name", PLANTS)
def test_its_eigenvalues_are_those_of_the_equations_by_hand(name):
    """The terminal voltage is that of the same instant there, and behind lags of 1 ms here."""
    device, hand = modelled(PLANTS[name])
    ours = AtSource(device, Z_NETWORK).eigenvalues(hand.source)
    wanted = [z for z in hand.eigenvalues() if SLOW < abs(z) < FAST]
    assert len(wanted) >= 4
    for z in wanted:
        assert min(abs(ours - z)) < 0.02 * abs(z), z


@pytest.mark.parametrize("name", PLANTS)
def test_its_voltage_after_a_jump_is_that_of_the_equations_by_hand(name):
    device, hand = modelled(PLANTS[name])
    source = 0.985 * hand.source
    ours, wanted = AtSource(device, Z_NETWORK).run(source, 0.6, 1e-3), hand.run(source, 0.6, 1e-3)
    assert np.ptp(wanted) > 2e-3
    assert np.abs(ours - wanted)[20:].max() < 0.02 * np.ptp(wanted)
