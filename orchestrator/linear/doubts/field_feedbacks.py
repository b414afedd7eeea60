"""Warnings of exciters whose feedback of the field voltage is at its limit where the machine starts.

ESST3A and EXST3 take min(K_G·E_fd, V_GMAX) off their inner regulator's input. Beyond V_GMAX that is a constant: the
loop around the inner regulator is open, without a sign in the steady state, which only has another reference."""

from collections.abc import Iterator

from orchestrator.core.options import Option
from orchestrator.systems.coupling.master import Master

_FIELD = "E_fd"  # output of a machine: its field voltage [pu]
_GAIN = "exciter.K_G"
_LIMIT = "exciter.V_GMAX"
_USUAL = 5.8  # limit in the sample data of IEEE 421.5 [pu]
_ROOM = 1.5  # part of the start's feedback up to which a limit leaves it room, where the usual one is below


def feedback_warnings(master: Master, setting: str = Option.SET) -> tuple[str, ...]:
    """Warn of feedbacks of the field voltage that do not act; for a master at its start.

    ``setting``: what is typed before a value by name."""
    return tuple(_open_feedbacks(master, setting))


def _open_feedbacks(master: Master, setting: str) -> Iterator[str]:
    for name, component in master.components.items():
        if not {_FIELD, _GAIN, _LIMIT} <= component.description.variables.keys():
            continue
        found = component.values([_FIELD, _GAIN, _LIMIT])
        field, gain, limit = (float(found[each]) for each in (_FIELD, _GAIN, _LIMIT))
        fed_back = gain * field
        if fed_back > limit:
            wanted = max(_USUAL, _ROOM * fed_back)
            yield (
                f"{name}: the feedback of its field voltage does not act at the operating point: {_GAIN} = {gain:g} "
                f"times {_FIELD} = {field:.4g} pu is {fed_back:.4g} pu, above its limit {_LIMIT} = {limit:g} pu, so "
                f"that the loop of the inner regulator is open, and modes are those without it; {_USUAL:g} pu is "
                f"usual: correct {_LIMIT} or {_GAIN}, as by {setting} {name}.{_LIMIT}={wanted:.3g}"
            )
