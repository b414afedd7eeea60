"""The records of dynamics data that give a unit its model or a part of it, with their fields; by PSS/E's name."""

from fmus.distributed_generation.dyr_records import DISTRIBUTED_RECORDS
from fmus.induction_machine.dyr_records import INDUCTION_RECORDS
from fmus.regfm_a1.dyr_records import REGFM_A1_RECORDS
from fmus.regfm_b1.dyr_records import REGFM_B1_RECORDS
from fmus.static_var.dyr_records import STATIC_VAR_RECORDS
from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from fmus.wecc_renewable.dyr_records import PLANT_RECORDS

RECORDS_OF_UNITS = (
    DYR_RECORDS
    | REGFM_A1_RECORDS
    | REGFM_B1_RECORDS
    | PLANT_RECORDS
    | STATIC_VAR_RECORDS
    | DISTRIBUTED_RECORDS
    | INDUCTION_RECORDS
)

COMPENSATORS = frozenset(record.part for record in STATIC_VAR_RECORDS.values())
"""Models that feed no active power."""
