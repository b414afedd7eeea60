"""Names that somebody may have meant."""

import difflib
from collections.abc import Iterable


def close_names(wanted: str, known: Iterable[str], otherwise: str = "") -> str:
    """A hint at names that look like the wanted one."""
    close = difflib.get_close_matches(wanted, list(known), n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else otherwise
