"""The table of opinions on an oscillation that a terminal and a page show."""

from collections.abc import Mapping

from orchestrator.core.units import whole_percent
from orchestrator.output.report.column_table import ShownTable
from orchestrator.studies.oscillations.location import DEF, DYNAMIC_MODE, QV_PHASE, Opinion
from orchestrator.studies.oscillations.models import OWN_MODEL
from orchestrator.studies.oscillations.verdict import Located

_PLACES = 5
"""Places that a method names in a table, the largest part first."""

_LEAST_PART = 0.005
"""Part of what is given from which on a place is named: less is told as 0 %."""

_MEANINGS: Mapping[str, str] = {
    OWN_MODEL: "gives current that its own model does not explain",
    DEF: "feeds energy to the oscillation",
    DYNAMIC_MODE: "takes part in the fitted mode",
    QV_PHASE: "gives more reactive power as its voltage rises",
}
"""What a place does that a method ranks."""


def opinions_table(head: str, one: Located) -> ShownTable:
    """The opinion of each method on where an oscillation comes from."""
    columns = ("Method: the place that …", "Applies", "Names", "Part of each, the largest first")
    rows = []
    for o in one.opinions:
        method = f"{o.method}: {_MEANINGS[o.method]}"
        rows.append((method, "yes" if o.applies else "no", o.place or "–", parts_of(o)))
    return ShownTable(head, columns, rows, left=4)


def parts_of(opinion: Opinion) -> str:
    """The places that give, each with its part of all that is given; those that take have no part in it.

    Where little is given beside what is taken, 100 % of it says nothing: that is told in its place."""
    giving = [(name, share) for name, share in opinion.ranking if share >= _LEAST_PART]
    if opinion.others_give:
        return "these places take more than they give"
    parts = (
        ", ".join(f"{name} {whole_percent(share)}" for name, share in giving[:_PLACES]) or "none"
    )
    observed = [name for name, _ in opinion.ranking]
    if opinion.place is None or opinion.place in observed:
        return parts
    return f"{opinion.place}, which the record does not measure; of those that it does: {parts}"
