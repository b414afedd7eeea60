"""The modes that bear names with a setting: those without controllers, followed while the gains grow."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import CAREFUL, follow_along, pair_at
from orchestrator.studies.coordinated_design.objective import UNMOVED
from orchestrator.studies.coordinated_design.open_loops import OpenLoops, Setting
from orchestrator.studies.coordinated_design.point import PointModes

# part of the gains with which the loops are as good as open, and have all their states
_OPEN = 1e-9


def followed(loops: OpenLoops, setting: Setting, value: complex) -> complex:
    """Where a mode of the open loops [rad/s] is with a setting.

    Raises `AnalysisError` if it meets another one on its way."""
    at = _scaled(loops, setting)
    return follow_along(pair_at(at(_OPEN), value), at, _OPEN, 1.0, CAREFUL).eigenvalue


def origin(loops: OpenLoops, setting: Setting, value: complex) -> complex:
    """Where a mode with a setting [rad/s] comes from: the same mode of the open loops.

    Raises `AnalysisError` if it meets another one on its way."""
    at = _scaled(loops, setting)
    return follow_along(pair_at(at(1.0), value), at, 1.0, _OPEN, CAREFUL).eigenvalue


def _scaled(loops: OpenLoops, setting: Setting) -> Callable[[float], LinearModel]:
    """The closed loops with a part of a setting's gains."""

    def at(part: float) -> LinearModel:
        scaled = {place: replace(own, gain=part * own.gain) for place, own in setting.items()}
        matrix = loops.closed(scaled)
        return LinearModel.from_matrix(matrix, tuple(map(str, range(len(matrix)))), None)

    return at


def with_followed_names(
    names: Sequence[str],
    before: Sequence[PointModes],
    after: Sequence[PointModes],
    setting: Setting,
) -> list[PointModes]:
    """The points with a setting, whose names are borne by the modes that bear them without it.

    A name that cannot be followed is borne by none there, whatever its mode's shape."""
    found = []
    for one, other in zip(before, after, strict=True):
        named = dict(other.named)
        for name in names if one.loops is not None and other.computed else ():
            named.pop(name, None)
            if (
                name in one.named
                and (place := _place(one, other, setting, one.named[name])) is not None
            ):
                named[name] = place
        found.append(replace(other, named=named))
    return found


def _place(one: PointModes, other: PointModes, setting: Setting, start: int) -> int | None:
    assert one.loops is not None
    try:
        value = followed(one.loops, setting, complex(one.values[start]))
    except AnalysisError:
        return None
    place = min(other.swinging, key=lambda k: abs(other.values[k] - value), default=None)
    return (
        place
        if place is not None and abs(other.values[place] - value) < UNMOVED * abs(value)
        else None
    )
