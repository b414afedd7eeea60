"""Values of variables as a model description writes them, by the variable's type in FMI."""

Scalar = float | int | bool | str

_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_RULES = {
    "Real": "a number, such as 0.5",
    "Integer": "a whole number of 64 bits at most, such as 2",
    "Enumeration": "the whole number of one of its items",
    "Boolean": "true, false, 1 or 0",
}


def typed(text: str, fmi_type: str) -> Scalar:
    """Read a value's text: a Real, Integer, Enumeration or Boolean is converted, any other type stays text."""
    try:
        match fmi_type:
            case "Real":
                return float(text)
            case "Integer" | "Enumeration":
                return _whole(text)
            case "Boolean":
                return _BOOLEANS[text.strip()]
            case _:
                return text
    except (KeyError, ValueError) as error:
        raise ValueError(f"a variable of type {fmi_type} takes {_RULES[fmi_type]}") from error


def _whole(text: str) -> int:
    value = int(text)
    if not -(2**63) <= value < 2**64:
        raise ValueError("it needs more than 64 bits")
    return value


def as_text(value: Scalar) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
