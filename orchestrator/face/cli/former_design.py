"""A parameter file that is there already: a design of another question is not lost in silence."""

from dataclasses import dataclass
from pathlib import Path

from orchestrator.cases.form.parameter_files import COMMENT
from orchestrator.core.foreign_files import one_line, read_text
from orchestrator.face.cli.terminal import say
from orchestrator.studies.pod_design.view import COMMAND, OUTCOME

_NOT_MET = "_not_met"  # ends the name of a file whose design leaves another one in its place


@dataclass(frozen=True)
class FormerDesign:
    """A parameter file by the command that made it and what came of it; "" of one written by hand."""

    command: str
    outcome: str

    @property
    def in_words(self) -> str:
        if not self.command:
            return "other parameters"
        return f"another design, `{self.command}`: {self.outcome}"


def former_design(path: Path, command: str) -> FormerDesign | None:
    """Return what a file holds; None where none is there, or where the same command made it."""
    if not path.is_file():
        return None
    lines = read_text(path, errors="replace").splitlines()
    comments = [one_line(line.removeprefix(COMMENT)) for line in lines if line.startswith(COMMENT)]
    rows = [row for row, text in enumerate(comments) if text.startswith(COMMAND)]
    if not rows:
        return FormerDesign("", "")
    made, said = comments[rows[0]].removeprefix(COMMAND), comments[rows[0] + 1 :]
    # a design for one operating point tells its mode first, one over points its verdict
    outcome = next((text for text in said if text.startswith(OUTCOME)), "".join(said[:1]))
    return None if made == command else FormerDesign(made, outcome)


def place_of_design(path: Path, command: str, *, met: bool, named: bool) -> Path:
    """Return where a design is written, and warn where another one is there.

    One that does not meet its requirement leaves another question's where it is, unless the file was named."""
    former = former_design(path, command)
    if former is None:
        return path
    if met or named:
        say(
            "warning",
            [f"{path} held {former.in_words}: it is replaced; give another --out to keep both"],
        )
        return path
    beside = path.with_name(f"{path.stem}{_NOT_MET}{path.suffix}")
    text = f"{path} stays as it was, with {former.in_words}; this design, which does not meet its requirement, is"
    say("warning", [f"{text} in {beside}"])
    return place_of_design(beside, command, met=met, named=True)
