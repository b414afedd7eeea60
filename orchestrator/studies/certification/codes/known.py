"""The grid codes that are installed: ours, and those of other distributions."""

from collections.abc import Mapping

from fmus.toolchain.plugins import Collections
from orchestrator.core.errors import InputError
from orchestrator.studies.certification.codes.row import CodeRow, DeclaredCode, GridCode, checked

KNOWN: Collections[GridCode[CodeRow] | DeclaredCode] = Collections(
    "gfor_cosim.codes", (GridCode, DeclaredCode)
)
"""Codes by the name that ``--code`` takes, ours first."""


def tables() -> dict[str, GridCode[CodeRow]]:
    """Codes whose rows are the same for every converter."""
    return {key: code for key, code in KNOWN.items() if isinstance(code, GridCode)}


def codes_by_declaration() -> dict[str, DeclaredCode]:
    """Codes whose rows depend on what the applicant declares."""
    return {key: code for key, code in KNOWN.items() if isinstance(code, DeclaredCode)}


def code_for(key: str, given: Mapping[str, object]) -> GridCode[CodeRow]:
    """The code of a name, for declared values.

    Raises an `InputError` if the values are not those that it takes, or its table cannot be used."""
    code = KNOWN[key]
    if isinstance(code, DeclaredCode):
        code = code.make(checked(code.declared, given, key))
    else:
        checked((), given, key)
    if code.fault:
        raise InputError(code.fault)
    return code
