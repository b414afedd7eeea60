"""Dependence of loads on the frequency by the records LDFRBL, LDFROW, LDFRZN, LDFRAR and LDFRAL of dynamics data.

    P = P_0·f^m,  Q = Q_0·f^n of constant powers;  I_P = I_P0·f^r,  I_Q = I_Q0·f^s of constant currents

Near rated frequency f^m is 1 + m·Δf. The narrower record goes first. Constant impedances depend on no record, as in
PSS/E.

Source: PowerWorld's guide to PSS/E's load model LDFR."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid.element_data import LAWS, Load
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.records_of_loads import RecordsOfLoads
from orchestrator.core.errors import Problem, QuestionTopic

FREQUENCY_RECORDS = ("LDFRBL", "LDFROW", "LDFRZN", "LDFRAR", "LDFRAL")
"""The records, the narrower first."""
_VALUES = 4  # m, n, r, s


@dataclass(frozen=True)
class RecordedFrequency:
    """Factors of Δf of P and Q by the name of the case's load, and places of the records that they are of."""

    factors: Mapping[str, tuple[float, float]]
    places: frozenset[tuple[str, int]]
    remarks: tuple[Problem, ...] = ()


def recorded_frequency(
    records: Sequence[DynamicRecord], file_loads: Sequence[FileLoad], loads: Sequence[Load]
) -> RecordedFrequency:
    """Return the factors of the loads that a record names and that are no constant impedances.

    Loads of one bus whose factors differ are one load here, with the mean by their powers."""
    of_loads = RecordsOfLoads(records)
    following = {load.name for load in loads if _may_follow(load)}
    members: dict[str, list[tuple[FileLoad, DynamicRecord | None]]] = {}
    for load in file_loads:
        if load.load in following:
            found = of_loads.first(load, FREQUENCY_RECORDS)
            record = found if found is not None and _numbers(found) else None
            members.setdefault(load.load, []).append((load, record))
    named = {name: own for name, own in members.items() if any(record for _, record in own)}
    used = [record for own in named.values() for _, record in own if record is not None]
    return RecordedFrequency(
        {name: _mean(own) for name, own in named.items()},
        frozenset((record.file, record.line) for record in used),
        tuple(_remarks(used)),
    )


def with_frequency(loads: Sequence[Load], recorded: RecordedFrequency) -> Iterator[Load]:
    """Yield the loads with the factors of their records."""
    for load in loads:
        k_pf, k_qf = recorded.factors.get(load.name, (load.k_pf, load.k_qf))
        yield replace(load, k_pf=k_pf, k_qf=k_qf)


def _may_follow(load: Load) -> bool:
    """Return whether a load draws power, not as a constant impedance, and nothing else says how the frequency acts."""
    impedance = LAWS["impedance"]
    is_impedance = load.active == impedance and load.reactive == impedance
    return load.p_mw > 0 and not is_impedance and not (load.k_pf or load.k_qf)


def _numbers(record: DynamicRecord) -> tuple[float, ...]:
    """Return m, n, r and s; nothing where the record has not these."""
    try:
        values = tuple(float(text) for text in record.values)
    except ValueError:
        return ()
    return values if len(values) == _VALUES else ()


def _mean(own: Sequence[tuple[FileLoad, DynamicRecord | None]]) -> tuple[float, float]:
    sums, totals = [0.0, 0.0], [0.0, 0.0]
    for load, record in own:
        factors = _numbers(record)[:2] if record is not None else (0.0, 0.0)
        for k, power in enumerate((load.p_mw, load.q_mvar)):
            sums[k] += power * factors[k]
            totals[k] += power
    k_pf, k_qf = (part / total if total else 0.0 for part, total in zip(sums, totals, strict=True))
    return k_pf, k_qf


def _remarks(used: Sequence[DynamicRecord]) -> Iterator[Problem]:
    """Say where constant currents have other exponents than constant powers."""
    for record in dict.fromkeys(used):
        m, n, r, s = _numbers(record)
        if (r, s) != (m, n):
            text = (
                f"{record.name}: r = {r:g} and s = {s:g} are of constant currents, m = {m:g} and n = {n:g} of constant "
                "powers; m and n are taken for whole loads"
            )
            topic = QuestionTopic("exponents of the frequency of constant currents")
            yield Problem(record.place, text, topic=topic)
