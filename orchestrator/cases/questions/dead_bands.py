"""Dead bands about the operating point: a control's loop has no gain within one, so that modes do not show it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_values import place_of, value_of
from orchestrator.core.options import Option
from orchestrator.systems.coupling.system import ComponentPlan

_NEVER_LEFT = 0.5  # end of a dead band [pu] from which on its loop is off: files write 1, 99 or 999


@dataclass(frozen=True, slots=True)
class DeadBand:
    """Ends of a dead band, and what of its loop acts beyond it.

    ``ends``: one that counts for both sides, or the lower and the upper; ``gains``: one at least is not 0 where the
    loop acts; ``switch``: it must be there and on as well."""

    ends: tuple[str, ...]
    gains: tuple[str, ...]
    loop: str
    switch: str = ""

    def hides(self, plan: ComponentPlan, scope: str) -> bool:
        """Return whether a loop that acts beyond the band rests within it."""
        widths = [abs(value_of(plan, f"{scope}{end}") or 0.0) for end in self.ends]
        gains = [value_of(plan, f"{scope}{gain}") for gain in self.gains]
        if not any(gains) or not 0 < min(widths) < _NEVER_LEFT:
            return False
        switch = f"{scope}{self.switch}"
        is_known = switch in plan.description.variables
        return not self.switch or (is_known and bool(plan.value(switch)))


_OF_GOVERNOR = "the governor's answer to the speed"
_OF_PLANT = (
    DeadBand(("dbd1", "dbd2"), ("Kp", "Ki"), "the plant's control of voltage or Q"),
    DeadBand(("fdbd1", "fdbd2"), ("Ddn", "Dup"), "the plant's answer to frequency", "Fflag"),
)
_OF_DISTRIBUTED = DeadBand(
    ("fdbd1", "fdbd2"), ("Ddn", "Dup"), "the answer to frequency", "FreqFlag"
)
_BANDS = {
    "governor.": (
        DeadBand(("db",), ("K_pgov", "K_igov", "K_P", "K_I"), _OF_GOVERNOR),
        DeadBand(("db_1",), ("K", "K_P", "K_I"), _OF_GOVERNOR),
    ),
    "plant.": _OF_PLANT,
    # a controller of several units is a component of its own, and so is distributed generation
    "": (*_OF_PLANT, _OF_DISTRIBUTED),
}
"""By the scope of their parameters in a component."""


@dataclass(frozen=True, slots=True)
class RestingLoop:
    """A loop that rests within its dead band: its component, the variables of the band's ends, and what it does."""

    component: str
    ends: tuple[str, ...]
    loop: str


def resting_loops(components: Mapping[str, ComponentPlan]) -> Iterator[RestingLoop]:
    """Yield the loops that rest within a dead band at the operating point, and act beyond it."""
    for name, plan in components.items():
        for scope, bands in _BANDS.items():
            for band in bands:
                if band.hides(plan, scope):
                    ends = tuple(f"{scope}{end}" for end in band.ends)
                    yield RestingLoop(name, ends, band.loop)


def dead_band_doubts(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about each dead band about the operating point, and tell how to see its loop in modes."""
    for one in resting_loops(draft.system.components):
        yield _doubt(draft, one)


def _doubt(draft: Draft, one: RestingLoop) -> UnusualValue:
    name, ends, loop = one.component, one.ends, one.loop
    plan = draft.system.components[name]
    given = " and ".join(f"{end} = {value_of(plan, end):g}" for end in ends)
    without = " ".join(Option.SET + f" {name}.{end}=0" for end in ends)
    text = (
        f"{given}: the operating point rests within this dead band, where {loop} has no gain, so modes are without "
        f"it; what it does beyond, such as an oscillation across the band, the modes with {without} show"
    )
    place = place_of(draft, name, *ends)
    return UnusualValue(f"{name}.{ends[0]}", place, text, f"a dead band ({loop})", ends[1:])
