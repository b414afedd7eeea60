"""A verdict as a value: its word, and the sentence behind it."""

from dataclasses import dataclass

from rich.markup import escape

COLOURS = {True: "green", False: "red", None: "yellow"}  # of a verdict that is good, bad or not known


@dataclass(frozen=True)
class VerdictSentence:
    """``word: text``, and whether that is good; None where it is not known."""

    good: bool | None
    word: str
    text: str

    def __str__(self) -> str:
        return f"{self.word}: {self.text}"

    def markup(self, subject: str = "") -> str:
        """The sentence for a terminal, its word in colour; ``subject`` says of what it is."""
        of = f" {escape(subject)}:" if subject else ""
        return f"[bold {COLOURS[self.good]}]{self.word}[/]:{of} {escape(self.text)}"
