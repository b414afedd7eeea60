"""Parameters that an FMU is looked at with: its tunable ones, moved within their bounds, and its switches."""

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.subject import Running, Subject

Look = TypeVar("Look")

Setting = Mapping[str, float | bool]  # values of parameters by their names


def elsewhere(subject: Subject, *, switches: bool = True) -> dict[str, float | bool]:
    """Other values of the tunable parameters, within their bounds; flags and counts move by 1 where they can."""
    found: dict[str, float | bool] = {}
    for name, info in subject.description.variables.items():
        if info.causality != "parameter" or info.variability != "tunable" or info.start is None:
            continue
        value, low, high = info.start_number, info.minimum, info.maximum
        # A whole number without a unit may stand for a flag, a mode or a count, which has no values between.
        flag = (
            info.type == "Real"
            and value == round(value)
            and abs(value) <= _MOST_MODES
            and (info.unit or "").strip().lower() in _NO_UNIT
        )
        if flag or info.type == "Integer":
            others = (
                []
                if low is None or high is None
                else [n for n in (value - 1, value + 1) if low <= n <= high]
            )
            if others and (flag or switches):
                found[name] = others[-1]
        elif info.type == "Real":
            moved = value * 1.1 if value else 0.1
            if (low is None or moved >= low) and (high is None or moved <= high):
                found[name] = moved
        elif info.type == "Boolean" and switches:
            found[name] = not _switched_on(subject, name)
    return found


_NO_UNIT = ("", "1", "-", "n/a", "na", "none", "unitless", "flag", "bool", "mode")
_MOST_MODES = 16  # a larger whole number is a gain or a time rather than a mode
_MOST_SWITCHES = 3  # switches that are tried one by one; where there are more, all together as well


def settings(subject: Subject) -> list[dict[str, float | bool]]:
    """Parameters to look at it with: as they are, and with its tunable Booleans the other way."""
    variables = subject.description.variables.values()
    names = [
        v.name
        for v in variables
        if v.causality == "parameter" and v.variability == "tunable" and v.type == "Boolean"
    ]
    toggled: dict[str, float | bool] = {n: not _switched_on(subject, n) for n in names}
    found = [{}, *({n: toggled[n]} for n in names[:_MOST_SWITCHES])]
    return [*found, toggled] if len(names) > _MOST_SWITCHES else found


def _in_words(setting: Setting) -> str:
    return (
        f", with {', '.join(f'{n} = {str(v).lower()}' for n, v in setting.items())}"
        if setting
        else ""
    )


def with_each_setting(
    subject: Subject, look: Callable[[Setting], Look]
) -> Iterator[tuple[Look, str]]:
    """Return what a look gives with one setting after another, and the setting in words.

    A setting with which the FMU does not work is passed over."""
    for setting in settings(subject):
        try:
            found = look(setting)
        except ComponentError:
            if not setting:
                raise
        else:
            yield found, _in_words(setting)


def _switched_on(subject: Subject, name: str) -> bool:
    return bool(subject.use.values.get(name, subject.description.variables[name].start_number))


def tune(running: Running, values: Setting) -> None:
    """Set parameters one by one, up to one that it refuses."""
    for name, value in values.items():
        try:
            running.component.set({name: value})
        except ComponentError:
            return
