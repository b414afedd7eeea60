"""A request says once what may be asked; options and keywords come from it."""

import argparse
import inspect
from dataclasses import dataclass, fields

import pytest

from orchestrator.core.asked import DAMPING, FLAG, NAMES, STAGES, asked_of, checked, request_field
from orchestrator.core.errors import InputError
from orchestrator.face.api.case import Case
from orchestrator.face.api.certification import certify
from orchestrator.face.api.scenario import Scenario
from orchestrator.face.cli.arguments import add_request_arguments, asked_by
from orchestrator.studies.certification.kinds import CertifyRequest
from orchestrator.studies.coordinated_design.study import PointsDesignRequest
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.modes.request import ModesRequest, StepsRequest
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.runs.run_request import RunRequest
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.sensitivities.request import SensitivitiesRequest
from orchestrator.studies.siting.study import SiteRequest
from orchestrator.studies.sweep.request import SweepRequest
from tests.test_docstrings import explained


@dataclass(frozen=True)
class Some:
    damping: float | None = request_field(DAMPING, None, "wanted")
    least_damping: float = request_field(DAMPING, 0.05, "of others", option="--min-damping")
    stages: int = request_field(STAGES, 2, "of the filter")
    names: tuple[str, ...] = request_field(NAMES, ("all",), "of converters", option="--name")
    refine: bool = request_field(FLAG, False, "search")
    margins: bool = request_field(FLAG, True, "in Python alone", option=None)


def read(*words):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_request_arguments(parser, Some)
    return Some(**asked_by(parser.parse_args(words), Some))


def test_options_that_are_not_given_leave_the_default():
    assert read() == Some()


def test_a_given_zero_is_no_default():
    """It is false to Python, and says something."""
    assert read("--stages", "0").stages == 0


def test_options_and_keywords_give_the_same_request():
    words = ["--damping", "20", "--min-damping", "7", "--name", "a", "--name", "b", "--refine"]
    keywords = {"damping": 20, "least_damping": 7, "names": ["a", "b"], "refine": True}
    assert read(*words) == Some(**checked(Some, keywords)) == Some(0.2, 0.07, 2, ("a", "b"), True)


def test_a_run_takes_one_thread_and_more_and_not_none():
    kind = asked_of(RunRequest)["threads"].kind
    for number in (1, 2):
        assert kind.read(str(number)) == kind.check(number, "threads") == number
    with pytest.raises(ValueError, match="from 1 to"):
        kind.read("0")
    with pytest.raises(InputError, match="from 1 to"):
        kind.check(0, "threads")
    assert kind.check(None, "threads") is None


def test_none_is_what_was_not_asked_only_where_it_is_the_default():
    assert checked(Some, {"damping": None}) == {"damping": None}
    with pytest.raises(InputError, match="least_damping = None"):
        checked(Some, {"least_damping": None})


def test_a_field_without_an_option_is_set_in_python_alone():
    with pytest.raises(SystemExit):
        read("--margins")


@pytest.mark.parametrize(
    ("method", "request_class"),
    [
        (Case.sweep, SweepRequest),
        (Case.screen, ScreeningRequest),
        (Case.interactions, InteractionsRequest),
        (Case.site, SiteRequest),
        (Case.design, DesignRequest),
        (Case.design_over_points, PointsDesignRequest),
        (Scenario.modes, ModesRequest),
        (Scenario.run, RunRequest),
        (Scenario.sensitivities, SensitivitiesRequest),
        (Scenario.steps, StepsRequest),
    ],
)
def test_a_method_has_the_keywords_and_the_words_of_its_request(method, request_class):
    """What `help` and notebooks show; type checkers take it from the class of the request itself."""
    keywords = list(inspect.signature(method).parameters)[1:]
    assert sorted(keywords) == sorted(asked_of(request_class))
    assert sorted(explained(inspect.cleandoc(method.__doc__))) == sorted(keywords)
    by_place = [one.name for one in fields(request_class) if not one.kw_only]
    assert keywords[: len(by_place)] == by_place


def test_a_function_has_the_keywords_and_the_words_of_its_request():
    assert list(inspect.signature(certify).parameters) == list(asked_of(CertifyRequest))
    assert sorted(explained(inspect.cleandoc(certify.__doc__))) == sorted(asked_of(CertifyRequest))


def test_defaults_are_shown_in_pythons_units():
    assert inspect.signature(Case.screen).parameters["damping"].default == 20
    assert inspect.signature(Case.design).parameters["least_damping"].default == 5


def test_a_plug_in_may_declare_its_fields_by_the_former_name():
    with pytest.warns(DeprecationWarning, match="asked is now .*request_field"):
        from orchestrator.core.asked import asked  # noqa: PLC0415
    assert asked is request_field
    with pytest.raises(ImportError):
        from orchestrator.core.asked import told  # noqa: F401, PLC0415
