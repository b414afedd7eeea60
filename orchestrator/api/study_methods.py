"""Methods of a case made from the requests of its studies, with their signature and documentation."""

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import MISSING, fields
from functools import partial
from inspect import Parameter, Signature, cleandoc, get_annotations
from pathlib import Path
from textwrap import indent
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from orchestrator.api.progress import shown_progress
from orchestrator.api.scenario import question
from orchestrator.asked import Asked, asked_of, checked, path, require_known
from orchestrator.cases.case import Case as CaseFile
from orchestrator.errors import InputError
from orchestrator.points.points import nobody
from orchestrator.points.store import POINTS
from orchestrator.points.study import PointStudy, Study, StudyAtOnce, choose_executor
from orchestrator.results.lock import held

Asks = ParamSpec("Asks")
Shown = TypeVar("Shown")


def method(
    name: str, request: Callable[Asks, Any], call: Callable[[CaseFile, Any], Shown]
) -> Callable[Concatenate[Any, Asks], Shown]:
    """A method of `Case`.

    Parameters
    ----------
    name
        As users call it.
    request
        Class of the request, whose fields are the keywords.
    call
        Computes what is asked for in a case.
    """
    assert isinstance(request, type)
    signature = _signature(request)

    def studied(self: Any, *given: Any, **wanted: Any) -> Shown:
        require_known(wanted, asked_of(request), name)
        bound = signature.bind(self, *given, **wanted).arguments
        return call(self.file, request(**checked(request, bound)))

    studied.__name__, studied.__qualname__, studied.__module__ = name, f"Case.{name}", "orchestrator.api.case"
    studied.__signature__ = signature  # type: ignore[attr-defined] # what `help` and notebooks show
    studied.__doc__ = _documentation(request)
    return studied


def of_study(name: str, study: Study[Asks, Shown]) -> Callable[Concatenate[Any, Asks], Shown]:
    """The method of a study."""
    return method(name, study.request, partial(_computed, study))


def _signature(request: type) -> Signature:
    listed = [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)]
    for one, asks in _listed(request):
        kind = Parameter.KEYWORD_ONLY if one.kw_only else Parameter.POSITIONAL_OR_KEYWORD
        default = Parameter.empty if asks.default is MISSING else asks.shown_default
        listed.append(Parameter(one.name, kind, default=default, annotation=one.type))
    return Signature(listed)


def _listed(request: type) -> Iterable[tuple[Any, Asked]]:
    """Fields in the order of their keywords: those that are given by place first, then the study's own."""
    every = asked_of(request)
    known = [one for one in fields(request) if one.name in every]
    own = set(get_annotations(request))
    known.sort(key=lambda one: (one.kw_only, one.name not in own))
    return [(one, every[one.name]) for one in known]


def _documentation(request: type) -> str:
    """What the class of the request says, with its fields as parameters."""
    text = cleandoc(request.__doc__ or "")
    summary, header, rest = text.partition("\nRaises\n------")
    lines = [f"{one.name}\n{indent(asks.meaning, '    ')}" for one, asks in _listed(request)]
    return f"{summary.rstrip()}\n\nParameters\n----------\n{chr(10).join(lines)}\n{header}{rest}\n"


def _computed(study: Study[..., Shown], file: CaseFile, request: Any) -> Shown:
    """Plan a study and compute it; a folder that keeps its points is kept from other commands meanwhile."""
    if isinstance(study, StudyAtOnce):
        return cast("Shown", study.compute(file, request, nobody))
    assert isinstance(study, PointStudy)
    cluster = (getattr(request, "scheduler", None), getattr(request, "tls", None))
    executor = choose_executor(request.workers, cluster[0], study.imports, cluster[1])
    planned = study.plan(file, request)
    question(study.prepared(planned), above=2)
    kept = None if request.folder is None else _folder(request.folder)
    title = study.counted.capitalize()
    with shown_progress(title, shown=request.progress) as report, nullcontext() if kept is None else held(kept):
        return cast("Shown", study.compute(planned, executor, kept, report))


def _folder(given: str | Path) -> Path:
    """The folder that keeps a study's points, made where missing."""
    place = path(given, "folder", "folder")
    try:
        (place / POINTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"folder = {str(place)!r}: points cannot be kept there: {error.strerror}; choose another"
        ) from error
    return place
