"""Methods and functions made from requests, with their signature and documentation."""

import re
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields
from functools import wraps
from inspect import Parameter, Signature, cleandoc, get_annotations
from inspect import signature as signature_of
from textwrap import indent
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from orchestrator.core.asked import Asked, asked_of, checked, require_known
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.interpreter_turn import turn

Asks = ParamSpec("Asks")
Shown = TypeVar("Shown")


def method(
    name: str, request: Callable[Asks, Any], call: Callable[[Any, Any], Shown]
) -> Callable[Concatenate[Any, Asks], Shown]:
    """A method; ``name`` is such as ``Case.sweep``.

    Its keywords are the fields of the request, and ``call`` computes what is asked of an object."""
    owner, _, last = name.partition(".")
    made = _function_of(request, [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)], call, last)
    return cast("Callable[Concatenate[Any, Asks], Shown]", _give_name(made, name, owner.lower()))


def function(
    name: str, module: str, request: Callable[Asks, Any], call: Callable[[Any], Shown]
) -> Callable[Asks, Shown]:
    """Make a function of the public face from a request, as `method` makes a method.

    Parameters
    ----------
    name
        Name of the function, such as ``nyquist``.
    module
        Module of the public face where users find it.
    request
        Class whose fields are the keywords.
    call
        Computes what a request asks.
    """
    return cast(
        "Callable[Asks, Shown]", _give_name(_function_of(request, [], call, name), name, module)
    )


def _function_of(request: Any, before: list[Parameter], call: Callable[..., Any], who: str) -> Any:
    signature = Signature([*before, *_parameters(request)])

    def studied(*given: Any, **wanted: Any) -> Any:
        require_known(wanted, asked_of(request), who)
        bound = _bind(signature, given, wanted, who)
        with turn:
            return call(*given[: len(before)], request(**checked(request, bound)))

    studied.__signature__ = signature  # type: ignore[attr-defined] # what `help` and notebooks show
    studied.__doc__ = _documentation(request)
    return studied


class WrongCallError(InputError, TypeError):
    """A function was called with too many arguments, or with too few."""


def _bind(
    signature: Signature, given: tuple[Any, ...], wanted: dict[str, Any], who: str
) -> dict[str, Any]:
    """Arguments by name; too many, too few or one given twice is one sentence of ours."""
    try:
        return signature.bind(*given, **wanted).arguments
    except TypeError as error:
        every = [one for one in signature.parameters.values() if one.name != "self"]
        by_place = [one.name for one in every if one.kind is Parameter.POSITIONAL_OR_KEYWORD]
        others = [one.name for one in every if one.kind is Parameter.KEYWORD_ONLY]
        by_name = f", and by name alone {', '.join(others)}" if others else ""
        raise WrongCallError(
            f"{who}: {error}; it takes by place {', '.join(by_place) or 'nothing'}{by_name}"
        ) from None


def in_turn(function: Callable[Asks, Shown]) -> Callable[Asks, Shown]:
    """A function that computes with FMUs: one thread at a time, as a method of a request."""

    @wraps(function)
    def waiting(*given: Asks.args, **wanted: Asks.kwargs) -> Shown:
        with turn:
            return function(*given, **wanted)

    return waiting


def by_known_keywords(function: Callable[Asks, Shown]) -> Callable[Asks, Shown]:
    """A function that refuses a keyword that it lacks in one sentence, with those that it has."""
    known = [*signature_of(function).parameters]

    @wraps(function)
    def call(*given: Asks.args, **named: Asks.kwargs) -> Shown:
        require_known(named, known, function.__name__)
        return function(*given, **named)

    return call


def _give_name(made: Any, name: str, module: str) -> Any:
    made.__name__, made.__qualname__, made.__module__ = (
        name.rpartition(".")[2],
        name,
        f"orchestrator.face.api.{module}",
    )
    return made


def _parameters(request: type) -> Iterable[Parameter]:
    for one, asks in _fields_in_order(request):
        kind = Parameter.KEYWORD_ONLY if one.kw_only else Parameter.POSITIONAL_OR_KEYWORD
        default = Parameter.empty if asks.default is MISSING else asks.shown_default
        yield Parameter(one.name, kind, default=default, annotation=one.type)


def _fields_in_order(request: type) -> Iterable[tuple[Any, Asked]]:
    """Fields in the order of their keywords: those that are given by place first, then the study's own."""
    every = asked_of(request)
    known = [one for one in fields(request) if one.name in every]
    own = set(get_annotations(request))
    known.sort(key=lambda one: (one.kw_only, one.name not in own))
    return [(one, every[one.name]) for one in known]


def _documentation(request: type) -> str:
    """Return what the class of the request says, with its fields as parameters."""
    text = cleandoc(request.__doc__ or "")
    summary, *rest = re.split(r"\n(?=\w+\n---)", text, maxsplit=1)
    lines = [
        f"{one.name}\n{indent(asks.meaning, '    ')}" for one, asks in _fields_in_order(request)
    ]
    parts = [summary.rstrip(), "\n".join(["Parameters", "----------", *lines]), *rest]
    return "\n\n".join(parts) + "\n"
