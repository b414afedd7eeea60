"""Usual ranges of machines, exciters, stabilisers, governors and turbines, by the parameter's full name."""

from fmus.toolchain.port_variables import TRANSFORMER
from fmus.toolchain.variables import usual_beside

MACHINE = TRANSFORMER | usual_beside(__file__)
