"""Text of C: literals, and the identity that every native FMU begins with."""

from collections.abc import Iterable


def identity_source(guid: str, digest: str) -> str:
    """The text before the source: the FMU's identity. The digest [hex] also marks the states that the FMU saves."""
    identity = ", ".join(str(b) for b in bytes.fromhex(digest)[:16])
    return f"static const char GUID[] = {c_string(guid)};\nstatic const unsigned char IDENTITY[16] = {{{identity}}};\n"


def c_string(text: str) -> str:
    """A C string literal; octal escapes, because a hexadecimal one would swallow digits after it."""
    plain = "".join(
        chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in text.encode()
    )
    return f'"{plain}"'


def c_array(kind: str, name: str, entries: Iterable[str], empty: str = "0") -> str:
    """A constant array in C; ``empty`` is its entry where it has none, because C knows no empty array."""
    return f"static const {kind} {name}[] = {{{', '.join(entries) or empty}}};"


def c_number(value: float | None, missing: str = "0") -> str:
    """A C literal of a number, to the last bit; ``missing`` where there is none."""
    return missing if value is None else repr(float(value))
