"""The draft of a binding."""

from pathlib import Path

from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError, ResultsError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_text
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.fmi.description import FmuDescription, read_declared


def bind(fmu: str | Path | FmuDescription, out: str | Path | None = None) -> str:
    """Draft what a foreign FMU's variables mean at our port; returns the text of a binding file.

    Lines with ``GUESS`` are to be confirmed, values ``REQUIRED`` to be filled in.

    Parameters
    ----------
    fmu
        The FMU, for whatever platform, or the ``description`` that `info` gives of it.
    out
        File that the draft is written to, over an older one; without it nothing is written.

    Raises
    ------
    InputError
        If the FMU cannot be used, or the file cannot be written.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> draft = gfor.bind(gfor.build("gfor"))
    >>> "[voltage]" in draft, "[current]" in draft
    (True, True)
    """
    description = fmu if isinstance(fmu, FmuDescription) else read_declared(path_of(fmu, "fmu"))
    place = None if out is None else path_of(out, "out", "path")
    text = draft_binding(description, None if place is None else place.parent)
    if place is not None:
        try:
            write_text(place, text)
        except ResultsError as error:
            raise InputError(Option.OUT + f" {error}") from error
    return text
