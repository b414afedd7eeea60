"""Records of a PSS/E dynamics file (DYR) → parts of `synchronous_generator` and their parameters.

Sources: PSS/E's model library as it is described in public (PowerWorld's and NEPLAN's model guides, ANDES' reader)."""

from fmus.toolchain.dyr_form import records_beside

DYR_RECORDS = records_beside(__file__)
"""By PSS/E's name. What a part holds and a record does not set keeps our default: give X'_d of GENCLS, and R_s of
every machine, from the network data (ZSORCE) as ``machine.X_d1`` and ``machine.R_s``; machine data are on ``S_n``
unless ``machine.S_data`` [MVA] says otherwise, as MBASE does."""

WITHOUT_REFERENCE = ("degov",)
"""Governors without a power reference, which no record of a supervisor can move."""

MACHINE_VARIANTS = {"genrou_rated_speed": "genrou"}
"""Machines that have the fields of another one's record, and differ in an assumption."""
