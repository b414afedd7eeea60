"""Two-terminal DC lines with line-commutated converters: a rectifier's and an inverter's station."""
