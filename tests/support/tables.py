"""Figures in the tables of our pages."""

import re


def figures(page: str, heading: str, label: str) -> list[list[float]]:
    """The numbers of each cell of a table's row, in the section below a heading; the label may cover several cells.

    Parameters
    ----------
    page
        Text of the page.
    heading
        Of the section, without its mark.
    label
        The row's first cells, as ``pss | FMUs``.
    """
    section = re.split(r"^#+ ", page.split(f"# {heading}\n", 1)[1], maxsplit=1, flags=re.MULTILINE)[
        0
    ]
    (line,) = [line for line in section.splitlines() if line.startswith(f"| {label} |")]
    cells = (
        line.removeprefix(f"| {label} |")
        .rstrip("| ")
        .replace("−", "-")
        .replace("± j", "")
        .split("|")
    )
    return [[float(x) for x in re.findall(r"-?\d+\.?\d*", cell)] for cell in cells]
