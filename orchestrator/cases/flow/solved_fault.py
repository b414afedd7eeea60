"""A fault of fewer than three phases as the sequence networks solved it."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SolvedFault:
    """A fault or an open pole as it was solved: impedances [pu, 100 MVA], None where no path is."""

    time: float
    place: str
    kind: str
    own: complex
    negative: complex | None
    zero: complex | None
    seen: complex | None
    source: str = ""

    @property
    def in_words(self) -> str:
        zero = f", Z0 = {_text_of(self.zero)}" if self.kind != "2-phase" else ""
        met = "the positive sequence meets an open circuit: no current flows there"
        if self.seen is not None:
            met = f"the positive sequence meets {_text_of(self.seen)} pu on 100 MVA"
            if self.kind == "2-phase-earth" and self.zero is None:
                met += ", as at two phases without earth"
        when = f"{self.kind} at {self.place}, t = {self.time:g} s"
        return f"{when}: Z2 = {_text_of(self.negative)}{zero} ({self.source}); {met}"

    def as_json(self) -> dict[str, Any]:
        parts = {"own": self.own, "Z2": self.negative, "Z0": self.zero, "seen": self.seen}
        return {
            "time": self.time,
            "place": self.place,
            "kind": self.kind,
            "source": self.source,
            "words": self.in_words,
            **{k: None if z is None else [z.real, z.imag] for k, z in parts.items()},
        }


def _text_of(z: complex | None) -> str:
    return "no path" if z is None else f"{z.real:.4g}{z.imag:+.4g}j"
