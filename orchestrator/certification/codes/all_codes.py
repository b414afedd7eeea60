"""The codes that `gfor certify --code` knows beside NTS 631."""

from orchestrator.certification.codes.aemo import AEMO
from orchestrator.certification.codes.ercot import ERCOT
from orchestrator.certification.codes.fingrid import FINGRID
from orchestrator.certification.codes.miso import MISO
from orchestrator.certification.codes.row import GridCode

CODES: dict[str, GridCode] = {code.key: code for code in (MISO, AEMO, ERCOT, FINGRID)}
"""By what ``--code`` takes."""
