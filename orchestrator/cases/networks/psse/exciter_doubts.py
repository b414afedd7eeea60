"""Questions that records of exciters raise by their values: order of fields, units, and limits that turn around."""

from collections.abc import Iterator, Mapping, Sequence

from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.unit_row import DoubtOfRecord

_RHEOSTATS = ("IEEET4", "IEEET5")
_OF_LIMITS_BY_SUPPLY = ("REXSYS", "REXSY1")

_LARGEST_ERROR = 0.2
"""Error of the voltage [pu] above which no rheostat's contacts are set: the voltage is held within some percent."""

_LONG_FIELD = 0.9
"""Time constant of an exciter's field [s] from which on the figure may be the constant KE, which is 1 or near it."""

_USUAL_CONSTANT = 1  # KE of a separately excited field [pu]


def doubts_of_exciters(
    records: Sequence[DynamicRecord], values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Yield the questions about a machine's exciter; ``values``: parameters that the machine's records set."""
    for record in records:
        if record.name in _RHEOSTATS:
            yield from _contacts(record, values)
            yield from _order(record, values)
        elif record.name in _OF_LIMITS_BY_SUPPLY:
            yield from _limits_by_supply(record, values)


def _contacts(record: DynamicRecord, values: Mapping[str, float]) -> Iterator[DoubtOfRecord]:
    """Ask about errors of the voltage that are too large, and about a dead band in which a rheostat rests for good."""
    for name in ("K_R", "K_V"):
        key = f"exciter.{name}"
        error, field = values.get(key, 0.0), name.replace("_", "")
        if error > _LARGEST_ERROR:
            text = (
                f"{record.name} has {field} = {error:g}, an error of the voltage per unit: above "
                f"{_LARGEST_ERROR:g} the regulator hardly ever acts; is it in percent? Then write {error / 100:g}"
            )
            yield DoubtOfRecord(key, record.place, text, f"{field} of {record.name} too large")
    dead, ceiling = values.get("exciter.K_R", 0.0), values.get("exciter.K_V", 0.0)
    if dead > ceiling:
        text = (
            f"{record.name} has KR = {dead:g} above KV = {ceiling:g}: the rheostat rests wherever V_R is not at a "
            "limit, so that nothing holds the voltage within KV; are the two swapped?"
        )
        yield DoubtOfRecord("exciter.K_R", record.place, text, f"KR of {record.name} above KV")


def _order(record: DynamicRecord, values: Mapping[str, float]) -> Iterator[DoubtOfRecord]:
    """Ask about TE and KE that are the more usual ones if they are exchanged."""
    time, constant = values.get("exciter.T_E", 0.0), values.get("exciter.K_E", 0.0)
    if time < _LONG_FIELD or not 0 < constant < time or constant == _USUAL_CONSTANT:
        return
    text = (
        f"{record.name} has TE = {time:g} s and KE = {constant:g}, which are as plausible the other way round: "
        "TE is read before KE, as PowerWorld and InterPSS have them, and OPAL-RT's IEEET5 has KE before TE; exchange "
        "them if the file has KE first"
    )
    yield DoubtOfRecord(
        "exciter.T_E", record.place, text, f"the order of TE and KE of {record.name}"
    )


def _limits_by_supply(
    record: DynamicRecord, values: Mapping[str, float]
) -> Iterator[DoubtOfRecord]:
    """Ask about limits that a deep dip of the voltage takes to 0."""
    share = values.get("exciter.F_1IMF", 0.0)
    if share <= 1:
        return
    text = (
        f"{record.name} has F1IMF = {share:g} above 1: its limits are times 1 + F1IMF·(v_t - 1), which falls below "
        f"0 where v_t is below {1 - 1 / share:.3g} pu (0 is taken there, so that the field collapses in such a dip); 1 "
        "is in proportion to v_t, 0 leaves them as they are"
    )
    yield DoubtOfRecord("exciter.F_1IMF", record.place, text, f"F1IMF of {record.name} above 1")
