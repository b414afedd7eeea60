"""Usual ranges of converters' parameters, by full name: of all parts that several converters share."""

from fmus.toolchain.port_variables import TRANSFORMER
from fmus.toolchain.variables import usual_beside

CONVERTER = TRANSFORMER | usual_beside(__file__)
# of converters that follow the grid by a PLL
FOLLOWING = CONVERTER | usual_beside(__file__, "usual_ranges_following.toml")
