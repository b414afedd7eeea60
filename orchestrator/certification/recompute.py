"""The commands that compute a point of a certificate again, beside its case file."""

from orchestrator.certification.case_file import CASE, WITH
from orchestrator.certification.point import COMPUTED, CONVERTER


def commands(X_L: float, scenario: str, *, identified: bool) -> dict[str, str]:
    """Commands for the modes and the response of a point, to be given in the certificate's folder."""
    which = f"{CASE} --scenario {scenario} --set grid.X_L={X_L!r}"
    low, high = COMPUTED
    modes = f"gfor modes {which} --range {low:g}:{high:g} --json"
    if identified and scenario == WITH:
        modes = f"gfor black-box {which} --component {CONVERTER} --json"
    return {"modes": modes, "response": f"gfor run {which} --out again"}
