"""Spain's damping test, NTS 631: a case of its own, at each of the norm's line reactances."""

from orchestrator.studies.certification.codes.row import GridCode, Row
from orchestrator.studies.certification.request import REACTANCES, row_of

NTS631 = "nts631"
NTS = GridCode.of(NTS631, tuple(Row(row_of(X), "the line's reactance", "5.10") for X in REACTANCES))
