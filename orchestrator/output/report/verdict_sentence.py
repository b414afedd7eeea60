"""A verdict's word and its sentence, for a terminal in colour."""

from dataclasses import dataclass

from rich.markup import escape

from orchestrator.output.report.colours import OF_VERDICTS


@dataclass(frozen=True)
class VerdictSentence:
    """``word: text``, and whether that is good; None if that is not known, or if it is so in part only."""

    good: bool | None
    word: str
    text: str

    def __str__(self) -> str:
        return f"{self.word}: {self.text}"

    def markup(self, subject: str = "") -> str:
        """The sentence for a terminal, its word in colour; ``subject`` says of what it is."""
        of = f" {escape(subject)}:" if subject else ""
        return f"[bold {OF_VERDICTS[self.good]}]{self.word}[/]:{of} {escape(self.text)}"
