"""Usual ranges of the converter's parameters, by full name."""

from fmus.converter_parts.usual_ranges import CONVERTER
from fmus.toolchain.variables import usual_beside

FORMING = CONVERTER | usual_beside(__file__)
