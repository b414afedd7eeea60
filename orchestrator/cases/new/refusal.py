"""The refusal of a case that is not written: it names the files and options that the case was to be made of."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.core.errors import CaseError, Problem
from orchestrator.core.options import Option

_PLACE = re.compile(r"(?:line \d+, )?(\w+)(?:\.(\w+))?(?:\.|$)")
"""A key of the case, with the line that it would have."""

_OPTIONS = {
    ("power_flow", "slack"): Option.SLACK,
    ("power_flow", "reactive_limits"): Option.REACTIVE_LIMITS,
    ("network", "frequency"): Option.FREQUENCY,
    ("network", "leave_out"): Option.LEAVE_OUT,
    ("network", "move_controls"): Option.MOVE_CONTROLS,
    ("network", "keep_load_parts"): Option.NO_LOAD_PARTS,
    ("units", "replace"): Option.REPLACE,
    ("units", "dyr_leave_out"): Option.DYR_LEAVE_OUT,
    ("units", "dyr_approximate"): Option.DYR_APPROXIMATE,
}
"""Key of the case → the option that writes it."""

_DYNAMICS = "units"  # table of the case that names the file of dynamics data
_DEVICES = "components"  # table of the case that holds the converters
_GRID = "grid"  # component there that is the network


def of_what_was_given(
    error: CaseError, sources: Mapping[str, Path], options: Mapping[str, Sequence[str]]
) -> CaseError:
    """Return the same refusal with places that exist.

    Parameters
    ----------
    error
        Refusal of the case as it would be written.
    sources
        Files of the network by the key of the case that names them.
    options
        Values that were given by option.
    """
    names = [path.name for path in sources.values()]
    problems = [_move_place(problem, sources, options) for problem in error.problems]
    return CaseError(", ".join(names), problems)


def _move_place(
    problem: Problem, sources: Mapping[str, Path], options: Mapping[str, Sequence[str]]
) -> Problem:
    """Return a problem at the option or the file that its key comes from; its text may begin with a record already."""
    found = _PLACE.match(problem.place)
    file = problem.place.partition(",")[0]
    if found is None or any(path.name == Path(file).name for path in sources.values()):
        return problem  # at a value of a file already
    table, key = found[1], found[2] or ""
    option = _option(table, key, options)
    network = next(path.name for key, path in sources.items() if key not in ("dyr", "seq"))
    dynamics = sources["dyr"].name if "dyr" in sources else network
    place = option or (dynamics if table == _DYNAMICS else network)
    if not option and key in sources:
        place = sources[key].name
    return replace(problem, place="" if problem.record and not option else place)


def _option(table: str, key: str, options: Mapping[str, Sequence[str]]) -> str:
    """Return an option with what was given, as it was typed; "" for a key that no option writes."""
    name = _OPTIONS.get((table, key), "")
    if table == _DEVICES and key != _GRID:
        name = Option.CONVERTER
    return " ".join([name, *map(shlex.quote, options.get(name, ()))])
