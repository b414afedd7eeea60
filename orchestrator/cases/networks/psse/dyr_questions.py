"""Questions that records of dynamics data raise."""

from collections.abc import Iterator, Mapping, Sequence

from fmus.grid_following.dyr_approximation import FIELDS
from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from fmus.toolchain.dyr_form import DyrField
from orchestrator.cases.networks.psse.dyr_counts import doubt_of_count
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, given_values
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.dyr_values import CEILING, FLOOR, chosen_ceiling
from orchestrator.cases.networks.psse.exciter_doubts import doubts_of_exciters
from orchestrator.cases.networks.psse.limiter_records import REACTIVE_LIMIT
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.unit_row import DoubtOfRecord

_LEAST_SIGNALS = ("uel.V_UIMIN", "uel.V_ULMIN")
"""Lower limits of a limiter's signal [pu]; the higher one counts."""

_INVERSE_TIME = (("oel.EFD1", "oel.TIME1"), ("oel.EFD2", "oel.TIME2"), ("oel.EFD3", "oel.TIME3"))
"""Points of MAXEX1's and MAXEX2's inverse time: field [of the rated one], and the time there [s]."""

_MOST_SIGNALS = ("oel.V_OELMAX1", "oel.V_OELMAX2", "oel.V_OELMAX3")
"""Upper limits of OEL2C's signal [pu], and of OEL3C's without the last; the lowest one counts."""

_INPUTS_OF_OEL2C = (1, 2)  # field voltage and field current
_VOLTAGE_OF_OEL3C = 1  # the input that is the field voltage

_LEAST_EXPONENT = (
    1  # of the inverse time of OEL3C, from which one is plausible: 1 in IEEE 421.5-2016
)

_MOST_REACTIVE = 3  # reactive power of a machine [pu], far above what one gives for long

_LIMITS_OF_COMPENSATORS = (
    ("Vrefmin", "Vrefmax", "the slow control cannot move the reference as it is meant"),
    ("Bmax", "Bshrt", "Bmax is taken for both, and the device has no short-time rating"),
    ("Vdbd2", "Vdbd1", "the regulator rests again before it acts"),
    ("Bpmin", "Bpmax", "the override turns around"),
    ("Vemin", "Vemax", "the error has one value alone"),
)
"""Limits of static var compensators, the one that is the lower first, and what becomes of them turned around."""

_SAME = 1e-3  # part by which two figures for one reactance may differ: files round them


def doubts_of_machine(
    machine: Machine, records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    yield from (doubt for record in records if (doubt := doubt_of_count(record)))
    yield from _omissions(records)
    yield from _leads_without_lags(records)
    yield from _chosen_limits(records)
    yield from doubts_of_exciters(records, values)
    yield from _offsets(records, values)
    yield from _inverse_times(records, values)
    yield from _of_oel2c(records, values)
    yield from _of_oel3c(records, values)
    yield from _of_oel4c(records, values)
    yield from _turned_limits(records, values)
    x_d2, x_source = values.get("machine.X_d2"), machine.source.imag
    if x_d2 is None or abs(x_source - x_d2) <= _SAME * abs(x_d2):
        return
    record = next(record for record in records if "machine.X_d2" in _sets(record.name))
    text = (
        f"{record.name} has X''d = {x_d2:g} pu, and the RAW file has ZX = {x_source:g} pu of the same machine in line "
        f"{machine.line}; PSS/E wants one figure in both, and X''d counts here; correct the one that is wrong"
    )
    yield DoubtOfRecord("machine.X_d2", record.place, text, "X''d unlike ZX of the RAW file")


def _omissions(records: Sequence[DynamicRecord]) -> Iterator[DoubtOfRecord]:
    """Return what a part of ours leaves out of its record, by the fields that ask for it."""
    for record in records:
        known = RECORDS_OF_UNITS.get(record.name)
        if known is None or not known.omissions:
            continue
        given = given_values(record, known.fields, {*RECORDS_OF_UNITS, *FIELDS})
        for name, text in known.omissions.items():
            if given[name]:
                said = f"{record.name} has {name} = {given[name]:g}: {text}"
                kind = f"{record.name} without {name}"
                yield DoubtOfRecord(known.kind, record.place, said, kind)


def _leads_without_lags(records: Sequence[DynamicRecord]) -> Iterator[DoubtOfRecord]:
    """Ask about a lead whose lag is 0: no block has it, so the stage of both is left out."""
    for record in records:
        known = RECORDS_OF_UNITS.get(record.name)
        leads = [] if known is None else [f for f in known.fields if _is_lead(f)]
        if known is None or not leads:
            continue
        given = given_values(record, known.fields, {*RECORDS_OF_UNITS, *FIELDS})
        for lead in leads:
            lag = lead.nothing_without
            if given[lead.name] and not given[lag]:
                text = (
                    f"{record.name} has {lead.name} = {given[lead.name]:g} and {lag} = 0: a lead without a lag, so the "
                    f"stage of both is left out, as GridPACK does; give {lag}, or {lead.name} = 0"
                )
                kind = f"{record.name} with a lead and no lag"
                yield DoubtOfRecord(lead.parameters[0], record.place, text, kind)


def _is_lead(field: DyrField) -> bool:
    return bool(field.nothing_without) and field.name.startswith("T")


def _offsets(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about a limiter whose signal is added to the voltage reference and rests far below 0."""
    least = max((values.get(name, 0.0) for name in _LEAST_SIGNALS), default=0.0)
    if least >= 0 or values.get("uel.gate", 0.0) > 0:
        return
    record = next(record for record in records if "uel.V_ULMIN" in _sets(record.name))
    text = (
        f"{record.name} rests at {least:g} pu, and its exciter adds that to the voltage reference: the limiter acts "
        "before its limit; where it is added VULMIN is 0, at a gate far below: correct VULMIN, or the exciter's record"
    )
    yield DoubtOfRecord("uel.V_ULMIN", record.place, text, "a limiter that rests below 0 at a sum")


def _inverse_times(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about a limiter of overexcitation whose points contradict each other."""
    points = [(values[field], values[time]) for field, time in _INVERSE_TIME if time in values]
    if not points:
        return
    record = next(record for record in records if "oel.EFD1" in _sets(record.name))
    fields, times = zip(*points, strict=True)
    wanted = values["oel.EFDDES"]
    listed = ", ".join(f"{time:g} s at {field:g}" for field, time in points)
    if list(fields) != sorted(fields):
        text = (
            f"{record.name} has points of its inverse time whose EFD do not rise ({listed}): it starts beyond the "
            f"first alone, {fields[0]:g} times EFDRATED; order EFD1, EFD2 and EFD3 upward, each with its time"
        )
        yield DoubtOfRecord("oel.EFD1", record.place, text, "points of a limiter out of order")
    elif list(times) != sorted(times, reverse=True):
        text = (
            f"{record.name} waits the longer the higher the field is ({listed}), and an inverse time falls: look at "
            "TIME1, TIME2 and TIME3"
        )
        yield DoubtOfRecord("oel.TIME1", record.place, text, "a limiter's time that rises")
    if wanted > fields[0]:
        text = (
            f"{record.name} has EFDDES = {wanted:g} above EFD1 = {fields[0]:g}: once it acts it lets the field stay "
            "beyond the point from which its time runs; look at EFDDES"
        )
        yield DoubtOfRecord("oel.EFDDES", record.place, text, "a limiter's aim beyond its limit")


def _of_oel2c(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about an OEL2C that limits what our part does not see, or that is made for a gate."""
    record = next((one for one in records if "oel.T_FCL" in _sets(one.name)), None)
    if record is None or "oel.input" not in values:
        return
    if values["oel.input"] not in _INPUTS_OF_OEL2C:
        text = (
            f"{record.name} has INPUT = {values['oel.input']:g}, and 1 is the field voltage, 2 the field current: the "
            "field voltage is limited; where it means the exciter's own field current, look at KSCALE, ITFPU, IINST "
            "and ILIM, or give INPUT = 1 or 2"
        )
        yield DoubtOfRecord(
            "oel.input", record.place, text, f"an input of {record.name} unlike 1, 2"
        )
    yield from _rests_above(record, values, "VOELMAX1, VOELMAX2 and VOELMAX3")
    given = given_values(record, RECORDS_OF_UNITS[record.name].fields, {*RECORDS_OF_UNITS, *FIELDS})
    if given["IFDRATED"] not in (0, 1):
        text = (
            f"{record.name} has IFDRATED = {given['IFDRATED']:g}, which no public diagram uses: its limits are taken "
            "per unit of KSCALE times the field voltage or current; make KSCALE 1/IFDRATED where they are not"
        )
        yield DoubtOfRecord("oel.K_scale", record.place, text, f"a rated current of {record.name}")


def _of_oel3c(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about an OEL3C whose input or exponent is doubtful, or that is made for a gate."""
    record = next((one for one in records if "oel.T_oel" in _sets(one.name)), None)
    if record is None or "oel.input" not in values:
        return
    if values["oel.input"] != _VOLTAGE_OF_OEL3C:
        text = (
            f"{record.name} has INPUT = {values['oel.input']:g}, and only of 1, the field voltage, its public source "
            "leaves no doubt: the field current is limited; where it means the exciter's own field current, look at "
            "KSCALE and ITFPU, or give INPUT = 1"
        )
        yield DoubtOfRecord("oel.input", record.place, text, f"an input of {record.name} unlike 1")
    if values["oel.K_1"] < _LEAST_EXPONENT:
        text = (
            f"{record.name} has K1 = {values['oel.K_1']:g}, an exponent below 1; its fields are read in the order "
            "INPUT ITFPU KSCALE TF K1 KOEL TOEL KPOEL VOELMAX1 VOELMIN1 VOELMAX2 VOELMIN2 of PowerWorld's help: "
            "look whether the record has them in that order"
        )
        yield DoubtOfRecord("oel.K_1", record.place, text, f"an exponent of {record.name} below 1")
    yield from _rests_above(record, values, "VOELMAX1 and VOELMAX2")


def _of_oel4c(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about an OEL4C whose limit is 0, or so high that it may be in Mvar, or that does not let go by itself."""
    record = next((one for one in records if REACTIVE_LIMIT in _sets(one.name)), None)
    if record is None or REACTIVE_LIMIT not in values:
        return
    given = given_values(record, RECORDS_OF_UNITS[record.name].fields, {*RECORDS_OF_UNITS, *FIELDS})
    if given["QREF"] == 0:
        text = (
            f"{record.name} has QREF = 0, for which PowerWorld takes the greatest reactive power of the power flow: QT "
            f"of the RAW file, {values[REACTIVE_LIMIT]:.4g} pu of MBASE, is taken; what PSS/E does no public source "
            "tells; give QREF"
        )
        yield DoubtOfRecord(REACTIVE_LIMIT, record.place, text, f"a limit of {record.name} of 0")
    elif given["QREF"] > _MOST_REACTIVE:
        text = (
            f"{record.name} has QREF = {given['QREF']:g}, which is per unit of MBASE, and no machine gives as much: it "
            "never limits; divide it by MBASE if it is in Mvar"
        )
        kind = f"a limit of {record.name} that nothing reaches"
        yield DoubtOfRecord(REACTIVE_LIMIT, record.place, text, kind)
    if given["TDELAY"] > 0 and given["KI"] > 0:
        text = (
            f"{record.name} has TDELAY = {given['TDELAY']:g} s, with which it does not let go by itself in Dynawo's "
            "diagram, which is taken: once it has acted, its integral stays where it is while the reactive power is "
            "below QREF, so that the machine may end below QREF (a run says by how much); what PSS/E does no public "
            "source tells; with TDELAY = 0 it lets go"
        )
        yield DoubtOfRecord(
            "oel.T_delay", record.place, text, f"{record.name} that does not let go by itself"
        )


def _rests_above(
    record: DynamicRecord, values: Mapping[str, float], limits: str
) -> Iterator[DoubtOfRecord]:
    """Ask about a limiter of overexcitation that rests above 0; ``limits``: names of its fields that decide that."""
    most = min((values[name] for name in _MOST_SIGNALS if name in values), default=0.0)
    if most > 0:
        text = (
            f"{record.name} rests at up to {most:g} pu, and its exciter adds that to the voltage reference: it acts "
            f"before its limit; where it is added the least of {limits} is 0, at a gate far above: correct it, or the "
            "exciter's record"
        )
        yield DoubtOfRecord(
            "oel.V_OELMAX1", record.place, text, "a limiter that rests above 0 at a sum"
        )


def _turned_limits(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about a compensator's limits of which the lower one is above the upper one."""
    for low, high, taken in _LIMITS_OF_COMPENSATORS:
        if low not in values or high not in values or values[low] <= values[high]:
            continue
        record = next((one for one in records if {low, high} <= _sets(one.name)), None)
        if record is None:
            continue
        text = f"{record.name} has {low} = {values[low]:g} above {high} = {values[high]:g}: {taken}; look at both"
        yield DoubtOfRecord(low, record.place, text, f"{low} of {record.name} above {high}")


def _sets(name: str) -> set[str]:
    return {
        p
        for field in (RECORDS_OF_UNITS[name].fields if name in RECORDS_OF_UNITS else ())
        for p in field.parameters
    }


def _chosen_limits(records: Sequence[DynamicRecord]) -> Iterator[DoubtOfRecord]:
    """Ask about the limits that PSS/E chooses."""
    for record in (record for record in records if record.name in DYR_RECORDS):
        known = DYR_RECORDS[record.name]
        given = given_values(record, known.fields, {*RECORDS_OF_UNITS, *FIELDS})
        ceiling = chosen_ceiling(known, given)
        if ceiling <= 0:
            continue
        text = (
            f"{record.name} has {CEILING} = 0, for which PSS/E chooses limits that hold the field voltage E2: "
            f"{CEILING} = -{FLOOR} = {ceiling:.4g} pu is taken"
        )
        if given["KE"] == 0:
            text += (
                ", and KE = 0 is such that V_R starts at a tenth of it, which moves modes (ANDES has no ceiling and "
                "KE = 0 there)"
            )
        kind = f"limits of {record.name} that PSS/E chooses"
        yield DoubtOfRecord("exciter.V_RMAX", record.place, text, kind)
