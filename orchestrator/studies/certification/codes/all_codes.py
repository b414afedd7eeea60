"""Our grid codes for `gfor certify --code`, each a table of rows in a module of its name; their words stand in
``words.toml``."""

from orchestrator.studies.certification.codes import rte
from orchestrator.studies.certification.codes.aemo import AEMO
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.fingrid import FINGRID
from orchestrator.studies.certification.codes.miso import MISO
from orchestrator.studies.certification.codes.nogrr245 import NOGRR245
from orchestrator.studies.certification.codes.prc029 import PRC029
from orchestrator.studies.certification.codes.row import DeclaredCode
from orchestrator.studies.certification.codes.tr331 import TR331

# by what ``--code`` takes
CODES = {code.key: code for code in (MISO, AEMO, ERCOT, NOGRR245, FINGRID, PRC029, TR331)}

ALL = CODES | {"rte": DeclaredCode("rte", rte.DECLARED, rte.rte_code)}
"""By name, as the entry-point group `gfor_cosim.codes` declares them."""
