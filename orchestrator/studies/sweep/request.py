"""The request of a sweep: its axes, and the condition until which it goes."""

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any

from orchestrator.cases.form.given import check_case_name
from orchestrator.core.asked import FieldKind, Names, plain_value, read_part, request_field
from orchestrator.core.errors import InputError
from orchestrator.studies.points.request import (
    OverCluster,
    of_black_box,
    of_frequencies,
    of_scenarios,
    of_values,
)
from orchestrator.studies.sweep.axes import Vary, parse_vary
from orchestrator.studies.sweep.limit import Until

_HOW = "such as {'grid.X_L': [0.1, 0.3]} or 'grid.X_L=0.1:0.5:9'"


def read_until(text: str) -> Until:
    """``unstable``, or a damping [%]."""
    if text.strip().lower() == "unstable":
        return Until()
    return Until(
        100
        * read_part("a damping from 0 to 100 % such as '5 %', or 'unstable'", 1e-6, 99.999)(text)
    )


def _until(given: Any, argument: str) -> Until | None:
    if given is None:
        return None
    try:
        return read_until(given if isinstance(given, str) else str(plain_value(given)))
    except ValueError as error:
        raise InputError(f"{argument}: {error}") from error


def _varied(vary: Any, argument: str) -> tuple[Vary, ...]:
    """Return what is varied, from values by name, from texts, or as it was read already."""
    if isinstance(vary, Mapping):
        wrong = [key for key in vary if not isinstance(key, str)]
        if wrong:
            raise InputError(f"{argument}: {wrong[0]!r} is not a name; give values by name, {_HOW}")
        for key, values in vary.items():
            check_case_name(key, argument)
            if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
                raise InputError(
                    f"{argument}: {key} = {values!r}; a sweep needs a list of values, {_HOW}"
                )
        lists = {key: tuple(map(plain_value, values)) for key, values in vary.items()}
        empty = [key for key, values in lists.items() if not values]
        if empty:
            raise InputError(
                f"{', '.join(empty)}: a sweep needs values, such as {{'grid.X_L': [0.1, 0.3]}}"
            )
        vary = [Vary(key, None, len(values), False, values) for key, values in lists.items()]
    if hasattr(vary, "columns"):
        raise InputError(
            f"{argument}: a {type(vary).__name__} is no grid; give lists by name, {_HOW}; a row for each operating "
            "point is what case.screen takes as points"
        )
    given: list[Any] = list(vary) if isinstance(vary, Iterable) else [None]
    given = [vary] if isinstance(vary, str) else given
    if not given or not all(isinstance(one, str | Vary) for one in given):
        raise InputError(f"{argument} = {vary!r}; give what is varied, {_HOW}")
    try:
        return tuple(one if isinstance(one, Vary) else parse_vary(one) for one in given)
    except ValueError as error:
        raise InputError(str(error)) from error


def _read_scr(text: str) -> Vary:
    bus, equals, values = text.partition("=")
    return parse_vary(f"{bus}: scr{equals}{values}")


_VARY = FieldKind(
    "COMPONENT.PARAMETER=START:STOP:COUNT",
    parse_vary,
    _varied,
    several=True,
    besides=(
        (
            "--scr",
            "BUS=START:STOP:COUNT",
            "SCR of the converters at a bus, or its short-circuit power "
            "('bus_9=3000 MVA:800 MVA:5'): R and X of all branches that end there are multiplied",
            _read_scr,
        ),
    ),
)
_UNTIL = FieldKind("unstable|PERCENT", read_until, _until)


@dataclass(frozen=True)
class SweepRequest(OverCluster):
    """Modes over a grid of parameters, followed from point to point.

    Raises
    ------
    InputError
        If a parameter, value, scenario, file or number of workers cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> sweep = gfor.load("two_area").sweep({"grid.X_L": [0.1, 0.2]}, ["gfor"])
    >>> named = sweep.table().query("named")
    >>> named[["grid.X_L", "frequency_hz", "damping_percent"]].round(2)
       grid.X_L  frequency_hz  damping_percent
    0       0.1          0.58            10.59
    1       0.2          0.43            18.01
    """

    vary: Mapping[str, Iterable[Any]] | Iterable[str | Vary] = request_field(
        _VARY,
        (),
        "what to vary; also =log:START:STOP:COUNT and =0.1,0.2,0.5 (repeatable: a full grid, followed along "
        "the last one); several together: 'grid.X_a,grid.X_b=…', 'grid.X_line_7_*=…', 'line_7_9,line_8_9: "
        "length=1:4:7'",
        python="values by ``component.parameter``, or texts as with ``--vary``: "
        '``"grid.X_L=0.1:0.5:9"``; modes are followed along the last one',
    )
    scenarios: Names = of_scenarios()
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    until: str | float | Until | None = request_field(
        _UNTIL,
        None,
        "how far the range START:STOP may go before the system is unstable, or a mode of --range is "
        "damped less than so many percent: coarse grid (COUNT, 9), then bisection",
        python='``"unstable"``, or a '
        'damping such as ``"5 %"``: bisect how far the only range that is varied may go, such as ``"grid.X_L=0.1:2"``; '
        "the result is in ``limits``",
    )
    black_box: bool = of_black_box()
    frequencies: tuple[float, float] = of_frequencies(
        "modes from the first to the second are followed [Hz]"
    )
