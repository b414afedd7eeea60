"""A request says once what may be asked; options and keywords come from it."""

import argparse
from dataclasses import dataclass

import pytest

from orchestrator.api.studies import Wanted, WantedInteractions, WantedOverPoints, WantedPlaces
from orchestrator.asked import DAMPING, FLAG, NAMES, STAGES, asked, asked_of, checked
from orchestrator.cli.arguments import add_request_arguments, asked_by
from orchestrator.coordinated_design.study import PointsDesignRequest
from orchestrator.errors import InputError
from orchestrator.interactions.request import InteractionsRequest
from orchestrator.pod_design.design import DesignRequest
from orchestrator.siting.study import SiteRequest


@dataclass(frozen=True)
class Some:
    damping: float | None = asked(DAMPING, None, "wanted")
    least: float = asked(DAMPING, 0.05, "of others", option="--min-damping", keyword="least_damping")
    stages: int = asked(STAGES, 2, "of the filter")
    names: tuple[str, ...] = asked(NAMES, ("all",), "of converters", option="--name")
    refine: bool = asked(FLAG, False, "search")
    margins: bool = asked(FLAG, True, "in Python alone", option=None)


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


def test_none_is_what_was_not_asked_only_where_it_is_the_default():
    assert checked(Some, {"damping": None}) == {"damping": None}
    with pytest.raises(InputError, match="least_damping = None"):
        checked(Some, {"least_damping": None})


def test_a_field_without_an_option_is_set_in_python_alone():
    with pytest.raises(SystemExit):
        read("--margins")


@pytest.mark.parametrize(
    ("request_class", "wanted", "files"),
    [
        (InteractionsRequest, WantedInteractions, {"devices", "bindings"}),
        (DesignRequest, Wanted, set()),
        (PointsDesignRequest, WantedOverPoints, set()),
        (SiteRequest, WantedPlaces, set()),
    ],
)
def test_the_keywords_that_editors_see_are_those_of_the_request(request_class, wanted, files):
    keywords = {one.keyword for one in asked_of(request_class).values()}
    assert (keywords | files) - {"device"} == set(wanted.__annotations__)
