"""Rules that the data of one component must obey together, by physics or by the model's equations."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Rule:
    """The parameter ``larger`` must exceed ``smaller``, or at least reach it."""

    larger: str
    smaller: str
    why: str
    may_be_equal: bool = False

    def holds(self, larger: float, smaller: float) -> bool:
        return larger > smaller or (self.may_be_equal and larger == smaller)

    def text(self, larger: str, smaller: str) -> str:
        must = "must not exceed" if self.may_be_equal else "must be less than"
        return f"{smaller} {must} {larger}: {self.why}"


_FIELD = "what a winding screens, it takes from the reactance; a machine without a field winding is not modelled"
_SCREENS = "a winding that reacts can only lower the reactance; equal says that there is no such winding"
_LEAKAGE = "the leakage reactance is what no rotor winding can screen"
_SLOWER = "the transient is by definition the slower one; check the units and whether the two are swapped"

_LIMITS = "the lower limit exceeds the upper one, or equals it; are the two swapped?"
LIMITS = (
    ("exciter.E_MAX", "exciter.E_MIN"),
    *((f"exciter.V_{k}MAX", f"exciter.V_{k}MIN") for k in ("R", "A", "I", "M")),
    *((f"governor.{q}_MAX", f"governor.{q}_MIN") for q in ("V", "P", "G")),
)
"""Limits of a machine's controls, the upper one first."""

RULES = (
    Rule("machine.X_d", "machine.X_d1", _FIELD), Rule("machine.X_d1", "machine.X_d2", _SCREENS, may_be_equal=True),
    Rule("machine.X_d2", "machine.X_l", _LEAKAGE), Rule("machine.X_q", "machine.X_q1", _SCREENS, may_be_equal=True),
    Rule("machine.X_q1", "machine.X_q2", _SCREENS, may_be_equal=True), Rule("machine.X_q2", "machine.X_l", _LEAKAGE),
    Rule("machine.T_d10", "machine.T_d20", _SLOWER), Rule("machine.T_q10", "machine.T_q20", _SLOWER),
    Rule("machine.s_12", "machine.s_10", "saturation rises with the flux; are the two swapped?", may_be_equal=True),
    *(Rule(upper, lower, _LIMITS) for upper, lower in LIMITS),
)  # fmt: skip
"""Rules of the machines' data. The FMUs refuse the same data in any tool; here the error names the line, before any FMU
is started."""

RESISTANCES = (("transformer.R_t", "transformer.X_t"), ("filter.R_c", "filter.X_c"), ("machine.X_d1", "machine.X_q1"))
"""Resistances and reactances, each with a larger one that it should not exceed."""
