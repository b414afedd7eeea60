"""Branches that are transformers, as far as a case or its network's file says."""

from collections.abc import Collection

from fmus.grid.element_data import Line


def is_known_transformer(
    line: Line, of_file: Collection[str] | None, of_case: Collection[str]
) -> bool:
    """Return whether a branch of two ends is a transformer.

    Parameters
    ----------
    line
        The branch.
    of_file
        Names of the transformers of the network's file; None where it does not tell, and a ratio does.
    of_case
        Names of those to which the case gives a vector group.
    """
    if line.name in of_case:
        return True
    return line.has_ratio if of_file is None else line.name in of_file
