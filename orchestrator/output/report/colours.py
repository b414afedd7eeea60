"""The colours of pages, plots and terminals."""

from collections.abc import Mapping

SERIES = ("#4d4d4d", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Distinguishable with any colour vision (Okabe and Ito); a scenario keeps its colour everywhere."""

GRID_LINES = "#e3e3e3"
"""Behind a plot's curves."""

OF_VERDICTS: Mapping[bool | None, str] = {True: "green", False: "red", None: "yellow"}
"""On a terminal: what is good, bad or not known."""

OF_MARKS: Mapping[str, str] = {
    mark: f"bold {OF_VERDICTS[good]}"
    for mark, good in (("good", True), ("bad", False), ("soft", None))
}
"""The same for the cells of a table, by the class that a page's style sheet has for them."""


def colour(index: int) -> str:
    """Return the colour of a scenario, or of another curve, by its number."""
    return SERIES[index % len(SERIES)]
