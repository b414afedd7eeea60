"""Request of a screening."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import partial
from math import inf
from typing import Any, cast

from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.given import Time, in_seconds
from orchestrator.core.asked import (
    FLAG,
    OUTAGES,
    FieldKind,
    Names,
    one_of,
    percent,
    read_percent,
    request_field,
)
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.units import to_unit
from orchestrator.studies.points.request import (
    POINTS_FILE,
    OverCluster,
    of_frequencies,
    of_protection,
    of_scenario,
    of_values,
)
from orchestrator.studies.screening.modes import MOST_DAMPING, CriticalRegion
from orchestrator.studies.screening.record import WantedRuns

_MOST = 100 * MOST_DAMPING


def _read_time(text: str) -> float:
    """Read a time [s] above 0."""
    seconds = to_unit(text, "s")
    if not 0 < seconds < inf:
        raise ValueError(f"{text!r} is no time above 0; write such as 5 or '200 ms'")
    return seconds


_TIME = FieldKind("T", _read_time, in_seconds)
_DAMPING = FieldKind(
    "PERCENT", partial(read_percent, most=_MOST), partial(percent, most=_MOST), unit="%", times=100
)


@dataclass(frozen=True)
class ScreeningRequest(OverCluster):
    """Critical modes of many operating points, each with its outages.

    Raises
    ------
    InputError
        If points, outages, scenario or values cannot be used; with file and line of what is wrong in the points.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> from pathlib import Path
    >>> lines = "time,grid.X_L", "00:00,0.1", "01:00,0.5"
    >>> _ = Path("day.csv").write_text(chr(10).join(lines))
    >>> screening = gfor.load("two_area").screen("day.csv", scenario="gfor")
    >>> screening.stable
    True
    >>> screening.modes()[["point", "frequency_hz", "damping_percent"]].round(2)
       point  frequency_hz  damping_percent
    0  00:00          0.58            10.57
    """

    points: Any = request_field(
        POINTS_FILE,
        None,
        "operating points: a CSV file, a row each (default: the case as it is)",
        python="CSV file or DataFrame, a row each: a column ``time`` or ``name``, and what differs from the case; or "
        '``{"night": {"load": 0.6}}``; the case as it is by default',
    )
    outages: Names | None = request_field(
        OUTAGES,
        None,
        "n-1, lines, units, or names such as line_1_2,sg3 or line_1_2+sg3 (repeatable)",
    )
    scenario: str | None = of_scenario()
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    sharing: str | None = request_field(
        one_of(SharingRule),
        None,
        "who feeds what an outage takes: droop (units by droop and rating, the default), "
        "rating, or slack (the slack alone)",
    )
    move_controls: bool = request_field(
        FLAG,
        False,
        "after an outage, taps and switched shunts of a RAW file move step by step to hold voltages in their bands",
        python="whether taps and switched shunts of a RAW file move after an outage until voltages are in their bands, "
        "rather than being held",
    )
    trips: Time | None = request_field(
        _TIME,
        None,
        "let each outage happen in a run that goes on for so long after it, such as '5 s', and say whose relays trip "
        "and who loses synchronism",
        python="how long a run goes on after each outage, such as ``'5 s'``: it says whose relays trip and who loses "
        "synchronism; without it there are no runs",
    )
    cleared_after: Time | None = request_field(
        _TIME,
        None,
        "in these runs a three-phase short circuit at the first bus of what is lost lasts so long before the outage, "
        "such as '100 ms'",
    )
    protection: str | None = of_protection()
    frequencies: tuple[float, float] = of_frequencies(
        "modes from the first to the second are critical [Hz], where they are damped less than ``damping``"
    )
    damping: float = request_field(
        _DAMPING, 0.2, "damping below which a mode is critical, at most 60 (default: 20)"
    )
    whole: bool = request_field(
        FLAG,
        False,
        "count growing modes of all frequencies at every point, as at few; takes longer",
        python="whether growing modes of all frequencies are counted at every point, rather than at one in 24 of many",
    )

    @property
    def wanted_runs(self) -> WantedRuns | None:
        """The runs of the outages; None where none is asked for."""
        if self.trips is not None:
            after = cast("float | None", self.cleared_after)
            return WantedRuns(cast("float", self.trips), after)
        if self.cleared_after is not None:
            raise InputError(
                Option.CLEARED_AFTER
                + " is of the runs that "
                + Option.TRIPS
                + " asks for; give "
                + Option.TRIPS
                + ", such as '5 s', as well"
            )
        return None

    @property
    def region(self) -> CriticalRegion:
        low, high = self.frequencies
        if not low > 0:
            raise InputError(
                f"frequencies {low:g}:{high:g} ("
                + Option.RANGE
                + "): a screening begins above 0 Hz"
            )
        return CriticalRegion(low, high, self.damping)
