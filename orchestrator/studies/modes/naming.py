"""Which modes of a model bear the names that a case gives."""

import fnmatch
import re
from collections.abc import Sequence
from functools import partial

from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.mode_names import Measure, Naming, name_modes, opposition
from orchestrator.linear.spectra.modes import Mode


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """Names that fit any of the patterns, such as ``sg*.omega``, in their own order."""
    # one expression, made once: a question for each of thousands of names and each pattern takes tenths of a second
    fits = re.compile("|".join(map(fnmatch.translate, patterns))).match
    return [name for name in names if fits(name)] if patterns else []


def named_modes(case: CaseDefinition, model: LinearModel, modes: Sequence[Mode]) -> Naming:
    """The modes whose shape the case describes, and what it describes without a clear answer."""
    return modes_named(case, model.names, modes)


def modes_named(case: CaseDefinition, names: Sequence[str], modes: Sequence[Mode]) -> Naming:
    """The same, from the names of the states alone."""

    def states(patterns: Sequence[str]) -> list[str]:
        return matching(names, patterns)

    measures: dict[str, Measure] = {}
    for table in case.table.analysis.modes:
        if table.against is not None:
            side, other = (states(patterns) for patterns in table.against)
            measures[table.name] = partial(opposition, side=side, other=other)
        else:
            measures[table.name] = partial(Mode.participation_of, states=states(table.states))
    return name_modes(modes, measures)
