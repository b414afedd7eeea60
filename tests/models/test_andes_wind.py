"""A wind turbine of WTDTA1, WTARA1, WTPTA1 and WTTQA1 beside ANDES: its eigenvalues at an infinite bus.

Compared are those of shaft, torque, pitch and power, below 20.5 1/s. The three of the reactive current above are
-33.9, -49.4 and -50 1/s in ANDES 2.0.0, and -35.4, -43.1 and -55.2 1/s by the equations by hand, as here.
"""

import json

import numpy as np
import pytest

from fmus.wecc_renewable.composed import wecc_plant_phasor
from tests.benchmarks import andes_wind as andes
from tests.models.closed import AtSource
from tests.models.parts import refused
from tests.models.test_wecc_plant_parts import parameters
from tests.support.evaluated import Evaluated

PEER = json.loads(andes.PLACE.read_text("utf-8"))
SLOW, FAST = 1e-3, 20.5  # eigenvalues [1/s] between which both are compared
DEVIATION = 1e-3  # of each eigenvalue's size: the terminal voltage here is behind lags of 1 ms
OWN = -2 * andes.CONTROL["Kqi"]  # of a tracking integrator that ANDES has where QFLAG leaves it out


@pytest.fixture(scope="module")
def ours():
    Z = complex(andes.R, andes.X)
    i = (andes.POWER - 1j * PEER["q"]) / andes.VOLTAGE
    angle = -np.angle(andes.VOLTAGE - Z * i)
    line = {
        f"{name}{k}": x
        for k, xy in enumerate(andes.LINE, 1)
        for name, x in zip(("P", "Spd"), xy, strict=True)
    }
    values = {
        "REGCA1": {"Tg": 0.02, "Lvplsw": False, "Lvpnt1": 0.8, "Lvpnt0": 0.4},
        "REECA1": andes.CONTROL | {"VMAX": 1.2, "VMIN": 0.8, "QMax": 0.8, "QMin": -0.8},
        "WTDTA1": andes.SHAFT,
        "WTARA1": andes.AERODYNAMICS,
        "WTPTA1": andes.PITCH | {"TetaMin": andes.LEAST_ANGLE},
        "WTTQA1": andes.TORQUE | line,
    }
    at = {"P_0": andes.POWER, "Q_0": PEER["q"], "v_0": andes.VOLTAGE, "theta_0": angle}
    at |= {"f_n": 60.0, "bus_voltage.tau": 1e-3}
    device = Evaluated(wecc_plant_phasor(" ".join(values)), parameters(values) | at)
    assert not refused(device)
    return AtSource(device, Z).eigenvalues(1.0)


def test_the_eigenvalues_are_those_of_andes(ours):
    wanted = [complex(*pair) for pair in PEER["modes"]]
    compared = [z for z in wanted if SLOW < abs(z) < FAST and abs(z - OWN) > SLOW]
    assert len(compared) == 7
    for z in compared:
        assert min(abs(ours - z)) < DEVIATION * abs(z), z


def test_another_shaft_would_be_seen(ours):
    """The shaft's swing is the pair: it tells a part in two hundred of its frequency."""
    (swing,) = [complex(*pair) for pair in PEER["modes"] if pair[1] > 1]
    assert min(abs(ours - 1.005 * swing)) > DEVIATION * abs(swing)
