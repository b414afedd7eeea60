"""Bindings: what the variables of a foreign FMU mean at our port."""
