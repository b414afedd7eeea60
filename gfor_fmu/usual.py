"""Usual ranges of the converter's parameters, by full name."""

from fmus.converter_parts.usual import CONTROL, CONVERTER, CURRENT, DROOP, VOLTAGE_DROOP
from fmus.toolchain.variables import Usual

_POD = {
    "T_W": Usual(0.3, 50, "a washout passes 0.1 to 2 Hz"),
    "T_f": Usual(0.001, 2, "a filter that passes 0.1 to 2 Hz"),
    "T_S1": Usual(0.001, 10, "a lead that turns 0.1 to 2 Hz", or_zero=True),
    "T_S2": Usual(0.001, 10, "a lag that turns 0.1 to 2 Hz", or_zero=True),
    "K": Usual(0, 10_000, "50 times the paper's 200"),
    "limit": Usual(0.002, 1.5, "up to the rating", or_zero=True),
}

FORMING = {
    **CONVERTER, "droop.R_f": Usual(0.001, 0.3, DROOP, or_zero=True),
    "droop.R_V": Usual(0.001, 0.5, VOLTAGE_DROOP, or_zero=True), "droop.tau_P": Usual(0.002, 2, CONTROL),
    "droop.tau_Q": Usual(0.002, 2, CONTROL), "voltage_control.tau": Usual(0.002, 0.5, CONTROL),
    "voltage_control.i_q_max": Usual(0.5, 5, CURRENT), "voltage_control.i_d_max": Usual(0.5, 5, CURRENT),
    **{f"{pod}.{name}": usual for pod in ("pod_p", "pod_q") for name, usual in _POD.items()},
}  # fmt: skip
