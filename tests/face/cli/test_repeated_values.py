"""``--set`` given more than once: a value overrides those before it."""

import argparse
import json
from argparse import Namespace

import pytest

from orchestrator.face.cli import screen
from orchestrator.face.cli.arguments import asked_by
from orchestrator.face.cli.case_arguments import values_set
from orchestrator.studies.screening.request import ScreeningRequest


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (
            [("gfor.P_0", 0.5), ("gf*.P_0", 0.2), ("gfor.P_0", 0.5)],
            [("gf*.P_0", 0.2), ("gfor.P_0", 0.5)],
        ),
        ([("gfor.P_0", 0.5), ("gfor.P_0", 0.4)], [("gfor.P_0", 0.4)]),
        (
            [("*.native", True), ("gfor.native", False)],
            [("*.native", True), ("gfor.native", False)],
        ),
    ],
)
def test_the_last_of_a_name_takes_the_last_place(given, found):
    assert list(values_set(Namespace(set=given)).items()) == found


def test_the_last_value_counts_in_a_sweep_and_for_modes(gfor, tmp_path):
    def modes(*texts):
        sets = [word for text in texts for word in ("--set", text)]
        code, out, _ = gfor(
            "modes", "infinite_bus", "--scenario", "dip", "--range", "0:100", "--json", *sets
        )
        assert code == 0
        code, swept, _ = gfor(
            "sweep",
            "infinite_bus",
            "--scenario",
            "dip",
            "--range",
            "0:100",
            "--json",
            *sets,
            "--vary",
            "gfor.pod_p.K=1,2",
            "--workers",
            1,
            "--out",
            tmp_path / texts[-1],
        )
        assert code == 0
        return json.loads(out)["scenarios"][0]["modes"], json.loads(swept)["scenarios"][0][
            "trajectories"
        ]

    repeated, alone = modes("gfor.P_0=0.5", "gf*.P_0=0.2", "gfor.P_0=0.5"), modes("gfor.P_0=0.5")
    assert repeated == alone
    assert repeated != modes("gfor.P_0=0.2")


def test_an_option_of_one_value_is_refused_a_second_time(gfor):
    for words in (
        ["run", "infinite_bus", "--out", "a", "--out", "b"],
        ["screen", "x", "--points", "a", "--points", "b"],
    ):
        code, _, error = gfor(*words)
        assert code == 2
        assert (
            f"argument {words[-2]}: it is given twice, and takes one value; give it once" in error
        )


def test_kinds_of_outages_that_are_given_apart_are_all_taken():
    parser = argparse.ArgumentParser()
    screen.add_arguments(parser)
    assert parser.parse_args(["case"]).outages is None
    both = parser.parse_args(["case", "--outages", "lines", "--outages", "units,load_3"])
    assert asked_by(both, ScreeningRequest)["outages"] == "lines,units,load_3"
