"""Limits of exciters and governors among a machine's parameters, by their names."""

import re

_LIMIT = re.compile(r"(?:exciter|governor)\.\w*(MAX|MIN)")


def is_limit(variable: str) -> bool:
    """Return whether a parameter is a limit of an exciter or a governor, such as ``exciter.V_RMAX``."""
    return _LIMIT.fullmatch(variable) is not None


def is_upper(variable: str) -> bool:
    return variable.endswith("MAX")


def is_wider(variable: str, value: float, than: float) -> bool:
    """Return whether a value of a limit leaves its signal more room than another value does."""
    return value > than if is_upper(variable) else value < than
