"""How loads follow voltage and frequency by the records IEELAL, IEELAR, IEELZN, IEELOW and IEELBL of dynamics data.

    P = P_0·(a_1·vⁿ¹ + a_2·vⁿ² + a_3·vⁿ³)·(1 + a_7·Δf),    Q = Q_0·(a_4·vⁿ⁴ + a_5·vⁿ⁵ + a_6·vⁿ⁶)·(1 + a_8·Δf)

They are of one load or bus (BL), an owner (OW), a zone (ZN), an area (AR), or all loads (AL); the narrower goes first.
v is relative to the power flow's voltage, and shares that miss 1 are scaled to it, as GridPACK has it.

ACMTBLU1 and its like are air conditioners while they run (`air_conditioners`); the records above go before them.

An exponent other than 0, 1 and 2 becomes the mixture of impedance, current and power that has the same power, slope and
curvature at the power flow's voltage. Source: GridPACK at bea5ce1a."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid.element_data import Load, Zip
from orchestrator.cases.networks.psse.air_conditioners import (
    AIR_CONDITIONERS,
    numbers_of_air_conditioner,
    running_law,
)
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import RecordsOfLoads
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.core.errors import Problem, QuestionTopic, few, number_of

LOAD_RECORDS = ("IEELBL", "IEELOW", "IEELZN", "IEELAR", "IEELAL")
"""The records, the narrower first."""
_VALUES = 14
_SUM = 1e-3  # by which shares may miss 1
_SHOWN = 8  # buses that a remark names; the others are counted
_LEAST_SHARE = 1e-6  # of a sum of shares that can be scaled to 1


@dataclass(frozen=True)
class RecordedLaw:
    """The laws of one record, and where it stands."""

    place: tuple[str, int]
    active: Zip
    reactive: Zip
    k_pf: float
    k_qf: float


@dataclass(frozen=True)
class RecordedLaws:
    """Laws by the name of the case's load, and places of the records that they are of."""

    laws: Mapping[str, RecordedLaw]
    places: frozenset[tuple[str, int]]
    remarks: tuple[Problem, ...] = ()


def recorded_laws(records: Sequence[DynamicRecord], loads: Sequence[FileLoad]) -> RecordedLaws:
    """Return the law of each load that a record names.

    Loads of one bus whose laws differ are one load here, with the mean of the laws by their powers.

    Raises
    ------
    InputError
        If records of air conditioners have not their numbers, or one that cannot be; with all of them.
    """
    own: dict[str, list[tuple[FileLoad, RecordedLaw | None]]] = {}
    of_loads, refusals = RecordsOfLoads(records), Refusals()
    for load in loads:
        with refusals.keep():
            own.setdefault(load.load, []).append((load, _law_for(load, of_loads)))
    refusals.tell()
    found, used = {}, set()
    for name, members in own.items():
        laws = [law for _, law in members if law is not None]
        if len(laws) == len(members):
            used |= {law.place for law in laws}
            found[name] = _mean([load for load, _ in members], laws)
    asked = (record for record in records if (record.file, record.line) in used)
    return RecordedLaws(found, frozenset(used), tuple(_remarks(asked)))


def _remarks(records: Iterable[DynamicRecord]) -> Iterator[Problem]:
    """Say where a record is not taken to the letter."""
    found = list(records)
    yield from _of_air_conditioners([x for x in found if x.name in AIR_CONDITIONERS])
    for record in found:
        if record.name in AIR_CONDITIONERS:
            continue
        values = [float(text) for text in record.values]
        for quantity, at in (("P", 0), ("Q", 3)):
            total = sum(values[at : at + 3])
            if abs(total - 1) > _SUM:
                text = f"{record.name}: the shares of {quantity} sum to {total:g}; they are scaled to 1"
                topic = QuestionTopic(f"shares of {quantity} that do not sum to 1")
                yield Problem(record.place, text, topic=topic)


def _of_air_conditioners(records: Sequence[DynamicRecord]) -> Iterator[Problem]:
    for name in dict.fromkeys(record.name for record in records):
        own = [record for record in records if record.name == name]
        buses = few(dict.fromkeys(str(record.bus) for record in own), _SHOWN)
        text = (
            f"{name}, air conditioners of one phase ({number_of(len(own), 'record')}: {buses}), is approximated: the "
            "loads draw near their voltage what running motors do; stalling, restarting, and the trips of contactors, "
            "undervoltage relays and thermal protection are left out. To see what that is worth, leave it out: "
            f"dyr_leave_out = ['{name}'] in [units]"
        )
        yield Problem(own[0].place, text, topic=QuestionTopic(f"{name} approximated"))


def with_recorded_laws(load: Load, law: RecordedLaw) -> Load:
    """Return the load with the law of a record."""
    return replace(load, active=law.active, reactive=law.reactive, k_pf=law.k_pf, k_qf=law.k_qf)


def _law_for(load: FileLoad, records: RecordsOfLoads) -> RecordedLaw | None:
    record = records.first(load, LOAD_RECORDS)
    if record is not None:
        return _law_of(record)
    record = records.first(load, AIR_CONDITIONERS)
    if record is None or not load.p_mw > 0:
        return None
    drawn = complex(load.p_mw, load.q_mvar)
    law = running_law(record, numbers_of_air_conditioner(record), drawn, load.v_pu)
    place = (record.file, record.line)
    return RecordedLaw(place, law.active, law.reactive, law.k_pf, law.k_qf)


def _law_of(record: DynamicRecord) -> RecordedLaw | None:
    try:
        values = [float(text) for text in record.values]
    except ValueError:
        return None
    if len(values) != _VALUES:
        return None
    shares, (k_pf, k_qf), powers = values[:6], values[6:8], values[8:]
    sums = sum(shares[:3]), sum(shares[3:])
    if min(map(abs, sums)) < _LEAST_SHARE:
        return None
    active, reactive = (
        mixture(shares[k : k + 3], powers[k : k + 3], total)
        for k, total in zip((0, 3), sums, strict=True)
    )
    return RecordedLaw((record.file, record.line), active, reactive, k_pf, k_qf)


def mixture(shares: Sequence[float], powers: Sequence[float], total: float) -> Zip:
    """Return the mixture with the power, slope and curvature of Σ shares·vⁿ at v = 1, over its sum."""
    z = i = p = 0.0
    for share, n in zip(shares, powers, strict=True):
        z += share / total * n * (n - 1) / 2
        i += share / total * n * (2 - n)
        p += share / total * (n - 1) * (n - 2) / 2
    return Zip(z, i, p)


def _mean(loads: Sequence[FileLoad], laws: Sequence[RecordedLaw]) -> RecordedLaw:
    return mean_of_laws(laws, [complex(load.p_mw, load.q_mvar) for load in loads])


def mean_of_laws(laws: Sequence[RecordedLaw], powers: Sequence[complex]) -> RecordedLaw:
    """Return the mean of laws by the powers [MW, Mvar] that follow them."""
    if len(set(laws)) == 1:
        return laws[0]
    of_p = list(_weights([power.real for power in powers]))
    of_q = list(_weights([power.imag for power in powers]))
    active, reactive = [law.active for law in laws], [law.reactive for law in laws]
    k_pf, k_qf = [law.k_pf for law in laws], [law.k_qf for law in laws]
    return replace(
        laws[0],
        active=_mean_law(active, of_p),
        reactive=_mean_law(reactive, of_q),
        k_pf=_mean_of(k_pf, of_p),
        k_qf=_mean_of(k_qf, of_q),
    )


def _mean_of(values: Sequence[float], weights: Sequence[float]) -> float:
    return sum(value * weight for value, weight in zip(values, weights, strict=True))


def _weights(powers: Sequence[float]) -> Iterator[float]:
    total = sum(powers)
    for power in powers:
        yield power / total if total else 1 / len(powers)


def _mean_law(laws: Sequence[Zip], weights: Sequence[float]) -> Zip:
    z, i, p = zip(*((law.z, law.i, law.p) for law in laws), strict=True)
    return Zip(_mean_of(z, weights), _mean_of(i, weights), _mean_of(p, weights))
