"""Cases: loaded by name or path, their scenarios chosen, and the studies of a whole case."""

import json
import re
import tomllib
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MethodType
from typing import TYPE_CHECKING, Any

from orchestrator.cases.case import Case as CaseFile
from orchestrator.cases.case import built_in_cases as names_of_cases
from orchestrator.cases.case import load_case
from orchestrator.cases.form.given import keep, path_of_given
from orchestrator.cases.form.locate import FROM_TEXT
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.schema import CaseTable
from orchestrator.core.asked import flag
from orchestrator.core.asked import path as path_of
from orchestrator.core.attributes import NoSuchAttributeError, Unchanged
from orchestrator.core.errors import InputError
from orchestrator.core.late import pd
from orchestrator.output.report.notebook import page
from orchestrator.output.results import origin

if TYPE_CHECKING:
    from orchestrator.face.api import choice, studies


def _from_python() -> dict[str, str]:
    from orchestrator.studies.points.code import code_hash  # noqa: PLC0415 - only where results are written

    return {"command": "from Python", "code": code_hash()}


origin.said.insert(0, _from_python)  # beneath what a command that runs says of itself


def built_in_cases() -> tuple[str, ...]:
    """Names of the built-in cases.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> [name for name in gfor.built_in_cases() if name.startswith("two_area")]
    ['two_area', 'two_area_rms']
    """
    return names_of_cases()


def load(case: str | Path | Mapping[str, Any], *, trust_fmus: bool = False) -> "Case":
    """Load a case.

    Parameters
    ----------
    case
        Name of a built-in case, path of a case file or an SSP archive, the text of a case file, or its tables. Of text
        and tables, paths are relative to ``directory`` in them, or to where the program runs.
    trust_fmus
        Whether FMUs of others may run in this process, where the file says ``isolated = false``; they can do there
        whatever you can. Without it such a file is refused.

    Raises
    ------
    InputError
        If there is neither, or the file cannot be read.
    CaseError
        If the file lacks what nothing can be checked without.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.load("infinite_bus").scenarios
    ('dip', 'load_step')
    """
    trusted = flag(trust_fmus, "trust_fmus")
    if isinstance(case, Mapping):
        return Case(
            load_case(
                path_of_given({"directory": str(Path.cwd()), **case}, "case.toml", "case"),
                trust_fmus=trusted,
            )
        )
    if isinstance(case, str) and "\n" in case:
        has_one = re.search(r"(?m)^directory\s*=", case)
        head = "" if has_one else f"{FROM_TEXT}directory = {json.dumps(str(Path.cwd()))}\n"
        return Case(load_case(keep(head + case, "case.toml"), trust_fmus=trusted))
    if not isinstance(case, str | Path) or not str(case):
        raise InputError(
            f"case = {case!r}; give a built-in case's name ({', '.join(names_of_cases())}) or a path"
        )
    path_of(case, "case")
    return Case(load_case(case, trust_fmus=trusted))


class _Late:
    """A method of a module that is imported where one is first asked for: `studies` takes a second, and `load` none."""

    def __init__(self, module: str) -> None:
        self._module = f"orchestrator.face.api.{module}"

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object, owner: type) -> Any:
        setattr(owner, self._name, getattr(import_module(self._module), self._name))
        return getattr(owner if instance is None else instance, self._name)


class Case(Unchanged):
    """A case: its scenarios, and the studies that concern all of it. `load` makes one.

    Attributes
    ----------
    file
        The case file, read.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> case = gfor.load("two_area")
    >>> case.scenarios
    ('base', 'gfor', 'pod_p', 'pod_q', 'pod_pq')
    >>> case
    <Case two_area: base, gfor, pod_p, pod_q, pod_pq>
    """

    _own = frozenset({"file"})
    _instead = "with_(…) makes a case with other tables"

    def __init__(self, file: CaseFile) -> None:
        if not isinstance(file, CaseFile):
            raise InputError(f"Case({file!r}): a case is opened by load({file!r})")
        self.file = file

    @property
    def name(self) -> str:
        """The case's name."""
        return self.file.name

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""
        return tuple(self.file.scenarios)

    def with_(self, *wrong: object, **tables: Any) -> "Case":
        """The case with other tables, such as ``events``, ``solver`` or ``network``; this one stays as it is.

        Parameters
        ----------
        tables
            As in a case file. Tables in tables are joined, lists replaced, and what is None is removed. A path in them
            is relative to where the program runs, or to the case's folder where the file is there alone.
        wrong
            Nothing: tables are given by name.

        Raises
        ------
        InputError
            If a case file has no such table.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> shorter = gfor.load("infinite_bus").with_(solver={"stop_time": "3 s"}, scenarios={"dip": None})
        >>> shorter.scenarios, shorter.scenario().prepared.stop_time
        (('load_step',), 3.0)
        """
        if wrong:
            raise InputError(
                f"with_({wrong[0]!r}): give tables by name, such as with_(solver={{'stop_time': '3 s'}}), or "
                "with_(**tables)"
            )
        known = {field.alias or name for name, field in CaseTable.model_fields.items()}
        unknown = [name for name in tables if name not in known]
        if unknown:
            hint = close_names(unknown[0], known)
            raise InputError(
                f"with_({unknown[0]}=…): a case file has no table {unknown[0]!r}; "
                f"{hint or 'it has ' + ', '.join(sorted(known))}"
            )
        given = {key: _from_here(table, self.file.directory) for key, table in tables.items()}
        return load(
            {"directory": str(self.file.directory)} | _joined(tomllib.loads(self.file.text), given),
            trust_fmus=self.file.trust_fmus,
        )

    if TYPE_CHECKING:
        scenario = choice.scenario
        choose = choice.choose
        sweep = studies.sweep
        screen = studies.screen
        site = studies.site
        interactions = studies.interactions
        design = studies.design
        design_over_points = studies.design_over_points
    else:
        scenario, choose = (_Late("choice") for _ in range(2))
        sweep, screen, site, interactions, design, design_over_points = (
            _Late("studies") for _ in range(6)
        )

    if not TYPE_CHECKING:  # a study of another distribution

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_") or name not in _studies():
                scenario = (
                    None
                    if name.startswith("_")
                    else import_module("orchestrator.face.api.scenario").Scenario
                )
                of = (
                    f"; it belongs to a scenario: case.scenario(…).{name}"
                    if hasattr(scenario, name)
                    else ""
                )
                if not of and not name.startswith("_"):
                    is_scenario = name in self.file.scenarios
                    of = f"; it is case.scenario({name!r})" if is_scenario else self._hint(name)
                raise NoSuchAttributeError(
                    f"{type(self).__name__!r} object has no attribute {name!r}{of}"
                )
            from orchestrator.face.api.studies import of_study  # noqa: PLC0415 - as `_Late`

            return MethodType(of_study(name, _studies()[name]), self)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *_studies()})

    def __repr__(self) -> str:
        return f"<Case {self.name}: {', '.join(self.scenarios)}>"

    def _repr_html_(self) -> str:
        titles = [table.title or name for name, table in self.file.scenarios.items()]
        table = pd.DataFrame({"scenario": self.scenarios, "title": titles})
        return page(f"{self.name}: {self.file.table.title or self.name}", table=table)


def _studies() -> Mapping[str, Any]:
    from orchestrator.studies.added import STUDIES  # noqa: PLC0415 - as `_Late`

    return STUDIES


_PATHS = frozenset(
    (
        "fmu",
        "dll",
        "binding",
        "scan",
        "raw",
        "dyr",
        "seq",
        "matpower",
        "pandapower",
        "cgmes",
        "file",
        "lines_file",
        "loads_file",
    )
)
"""Entries of a case file that are paths."""


def _from_here(table: Any, directory: Path, key: str = "") -> Any:
    """A table with paths from where the program runs; those of files that only the case's folder has stay."""
    if isinstance(table, Mapping):
        return {name: _from_here(one, directory, name) for name, one in table.items()}
    if isinstance(table, list | tuple):
        return [_from_here(one, directory, key) for one in table]
    if key not in _PATHS or not isinstance(table, str | Path) or Path(table).is_absolute():
        return table
    here = Path.cwd() / table
    return str(table if not here.exists() and (directory / table).exists() else here)


def _joined(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes: inner tables are joined, and what is None is removed."""
    found = {key: value for key, value in tables.items() if changes.get(key, value) is not None}
    for key, new in changes.items():
        if isinstance(new, Mapping):
            old = tables.get(key)
            found[key] = _joined(old if isinstance(old, Mapping) else {}, new)
        elif new is not None:
            found[key] = new
    return found
