"""Parameters that a record of dynamics data sets, with the limits that PSS/E chooses."""

from collections.abc import Mapping

from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from fmus.toolchain.dyr_form import (
    SIGNALS_OF_BUSES,
    DyrField,
    DyrRecord,
)
from orchestrator.cases.form.remedies import APPROXIMATING, without_models
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, given_values
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.core.errors import InputError

_RATING = "S_n"
"""Parameter with a unit's rating [MVA]; a controller of several plants may leave the base to the system."""

_BUS = "BUSR"
"""Field of a converter's control that names a bus; 0 and the machine's own are its terminal."""


def _refuse_choice(record: DynamicRecord, field: DyrField, value: float) -> None:
    """Refuse a value that our part cannot stand for."""
    if field.name == _BUS:
        if value == record.bus:
            return
        instead = "for the terminal"
        if record.name in FIELDS:
            instead = f"for the terminal, or {APPROXIMATING} for {MODEL}"
        raise InputError.at(
            record.place,
            f"{record.name} has {_BUS} = {value:g}: its control measures at another bus "
            f"than its terminal, which no part of ours does; write {_BUS} = 0 {instead}",
        )
    allowed = " or ".join(f"{x:g}" for x in field.only)
    raise InputError.at(
        record.place, f"{record.name} has {field.name} = {value:g}; only {allowed} can be modelled"
    )


CEILING = "VRMAX"
"""Field of an exciter's record with the upper limit of its regulator."""

FLOOR = "VRMIN"
"""Field with the lower limit."""


def chosen_ceiling(known: DyrRecord, given: Mapping[str, float]) -> float:
    """Return VRMAX that PSS/E chooses for a shaft's exciter that gives none [pu]; 0 where it is no such exciter.

    It holds the field voltage E2: SE(E2)·E2, with KE·E2 where KE exceeds 0. Sources: OpenIPSL
    (`calculate_dc_exciter_params.mo`), which leaves the factor E2 out where KE exceeds 0; IEEE 421.5."""
    choosing = any(field.name == "KE" and field.zero_sets for field in known.fields)
    if not choosing or given.get(CEILING) != 0:
        return 0.0
    return (max(given["KE"], 0.0) + given["SE(E2)"]) * given["E2"]


def _read_numbers(record: DynamicRecord, known: DyrRecord) -> dict[str, float]:
    """Return the numbers of a record, with the limits that PSS/E chooses."""
    given = given_values(record, known.fields, {*RECORDS_OF_UNITS, *FIELDS})
    ceiling = chosen_ceiling(known, given)
    if ceiling > 0:
        given |= {CEILING: ceiling, FLOOR: -ceiling}
    return given


def values_of_record(record: DynamicRecord, known: DyrRecord) -> dict[str, float]:
    given = _read_numbers(record, known)
    found = dict.fromkeys(known.lacks, 0.0) | dict.fromkeys(known.without, False)
    found |= dict.fromkeys(known.switched_on, True)
    for field in (field for field in known.fields if not field.is_text):
        value = given[field.name]
        if field.nothing_without and given[field.nothing_without] == 0:
            value = 0.0
        if field.only and value not in field.only:
            _refuse_choice(record, field, value)
        if (
            field.bus_of
            and value not in (0, record.bus)
            and given[field.bus_of] in SIGNALS_OF_BUSES
        ):
            raise InputError.at(
                record.place,
                f"{record.name} has {field.name} = {value:g}: its signal, {field.bus_of} = "
                f"{given[field.bus_of]:g}, is taken at another bus than the machine's own, "
                f"which no part of ours does; write {field.name} = 0 for the own bus, or "
                f"{without_models([record.name])}, and no {record.name} acts",
            )
        if field.same_as and value != given[field.same_as]:
            raise InputError.at(
                record.place,
                f"{record.name} has {field.name} = {value:g} and {field.same_as} = "
                f"{given[field.same_as]:g}; our part has one value for both",
            )
        if field.not_zero and value == 0:
            raise InputError.at(
                record.place,
                f"{record.name} has {field.name} = 0, which PSS/E replaces; give its value",
            )
        if _RATING in field.parameters and known.kind == "converter" and value <= 0:
            raise InputError.at(
                record.place,
                f"{record.name} has {field.name} = {value:g}: the base of its values must exceed 0; "
                "write its rating in MVA",
            )
        if field.zero_sets:
            found[field.zero_sets] = value == 0
        product = value * given[field.times] if field.times else value
        product = bool(value) if field.switch else product
        found |= dict.fromkeys(field.parameters, product) | dict.fromkeys(field.negated, -product)
    return found
