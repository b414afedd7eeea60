"""The codes that `gfor certify --code` knows beside NTS 631."""

from collections.abc import Callable, Mapping, Sequence

from orchestrator.certification.codes import rte
from orchestrator.certification.codes.aemo import AEMO
from orchestrator.certification.codes.declared import Declaration, checked
from orchestrator.certification.codes.ercot import ERCOT
from orchestrator.certification.codes.fingrid import FINGRID
from orchestrator.certification.codes.miso import MISO
from orchestrator.certification.codes.nogrr245 import NOGRR245
from orchestrator.certification.codes.prc029 import PRC029
from orchestrator.certification.codes.row import GridCode
from orchestrator.certification.codes.tr331 import TR331

CODES = {code.key: code for code in (MISO, AEMO, ERCOT, NOGRR245, FINGRID, PRC029, TR331)}  # by what ``--code`` takes

BY_DECLARATION: dict[str, tuple[Sequence[Declaration], Callable[[Mapping[str, float]], GridCode]]] = {
    "rte": (rte.DECLARED, rte.rte_code)
}
"""Codes whose rows depend on what the applicant declares: what that is, and the code for it."""


def code_for(key: str, given: Mapping[str, object]) -> GridCode:
    if key in CODES:
        checked((), given, key)
        return CODES[key]
    wanted, made = BY_DECLARATION[key]
    return made(checked(wanted, given, key))
