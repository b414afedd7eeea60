"""The table of opinions on an oscillation that a terminal and a page show."""

from orchestrator.output.report.column_table import ShownTable
from orchestrator.studies.oscillations.verdict import Located

_PLACES = 5
"""Places that a method names in a table, the largest part first."""


def opinions_table(head: str, one: Located) -> ShownTable:
    """The opinion of each method on where an oscillation comes from."""
    columns = ("Method", "Applies", "Names", "Places, the largest part first")
    rows = []
    for o in one.opinions:
        ranked = ", ".join(f"{name} {100 * share:.0f} %" for name, share in o.ranking[:_PLACES])
        rows.append((o.method, "yes" if o.applies else "no", o.place or "–", ranked))
    return ShownTable(head, columns, rows, left=4)
