"""The control part of the converter, measured in kV and kA: in per unit it is the same at every rating."""

import numpy as np
import pytest

from gfor_fmu.control import grid_forming_control
from tests.support.evaluated import Evaluated

S_N, V_N = 500.0, 110.0
"""Another rating [MVA] and rated voltage [kV] than the model's own."""

ANYWHERE = 1 + 0.1 * np.sin(np.arange(9) ** 2)
"""Factors by which nine measured values are away from the start, no two alike."""


def test_quantities_in_per_unit_have_the_same_rates_and_bridge_voltage_at_any_rating():
    model = grid_forming_control()
    own, other = Evaluated(model), Evaluated(model, {"S_n": S_N, "V_n": V_N})
    volt = V_N / own.parameters["V_n"]
    power = S_N / own.parameters["S_n"]
    measured = np.array([float(v.start) for v in model.inputs]) * ANYWHERE
    assert [v.name[:-2] for v in model.inputs] == 3 * ["u"] + 3 * ["i_s"] + 3 * ["i_g"]
    scaled = measured * np.repeat([volt, power / volt, power / volt], 3)
    assert other.rates(scaled) == pytest.approx(own.rates(measured), rel=1e-9, abs=1e-9)
    factors = {"v_a": volt, "v_b": volt, "v_c": volt, "p": power, "q": power}
    wanted = {name: factors.get(name, 1.0) * v for name, v in own.outputs(measured).items()}
    assert other.outputs(scaled) == pytest.approx(wanted, rel=1e-9, abs=1e-9)
