"""Usual ranges of converters' parameters, by full name: of all parts that several converters share."""

from fmus.toolchain.port_variables import TRANSFORMER
from fmus.toolchain.variables import Usual

FILTER = "usual LC filters and transformers of converters"
CONTROL = "usual time scales of converter control"
DROOP = "grid codes: 2 to 12 % of rated frequency at rated power"
VOLTAGE_DROOP = "usual voltage droops: 2 to 10 %"
CURRENT = "usual current limits: 1 to 3 of the rated current"

CONVERTER = {
    **TRANSFORMER, "filter.R_c": Usual(0, 0.1, FILTER), "filter.X_c": Usual(0.01, 0.6, FILTER),
    "filter.B_c": Usual(0.01, 0.6, FILTER), "current_control.tau": Usual(0.0002, 0.02, CONTROL),
    "feed_forward.tau": Usual(1e-5, 0.02, CONTROL), "current_limit.I_max": Usual(0.5, 5, CURRENT),
}  # fmt: skip

FOLLOWING = {
    **CONVERTER, "pll.f_0": Usual(0.5, 100, "PLLs of 1 to 50 Hz, widened"),
    "pll.xi": Usual(0.2, 3, "PLLs of usual damping"), "measurement.tau": Usual(0.001, 0.2, CONTROL),
    "active_power.tau": Usual(0.005, 5, CONTROL), "reactive_power.tau": Usual(0.005, 5, CONTROL),
    "reactive_power.R_V": Usual(0.001, 0.5, VOLTAGE_DROOP),
    "reactive_power.X_s": Usual(0.05, 2, "short-circuit ratios of 0.5 to 20"),
    "frequency_droop.R_f": Usual(0.002, 0.3, DROOP),
}  # fmt: skip
"""The same for converters that follow the grid by a PLL."""
