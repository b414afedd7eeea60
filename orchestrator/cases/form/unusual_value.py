"""A value that is most unusual, and the question that it raises."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class UnusualValue:
    """A value of a case or of a network's file that is possible, but so unusual that gfor asks whether it is meant.

    Attributes
    ----------
    name : str
        The variable, ``component.variable``; ``meant`` in the case file confirms it by this name.
    place : str
        File and line of the value, as messages write them.
    text : str
        The question: the value seen, what is usual, and why it matters.
    kind : str
        The question without figures and elements: the same for questions that one answer could settle.
    compared : tuple of str
        The component's other variables whose values the question is about as well.
    """

    name: str
    place: str
    text: str
    kind: str
    compared: tuple[str, ...] = ()
