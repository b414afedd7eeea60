"""Questions about exciters' records: contacts of rheostats, the order of TE and KE, limits that turn around."""

import re

import pytest

from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine

GENROU = "1 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /\n"
IEEET4 = "1 'IEEET4' 1 {KR} 20 {KV} 5 -2 {TE} {KE} 3 0.4 4 0.8 /"
IEEET5 = "1 'IEEET5' 1 20 {KV} 5 -2 {TE} {KE} 3 0.4 4 0.8 /"
USUAL = {"KR": 0.01, "KV": 0.05, "TE": 0.5, "KE": 1}
REXSYS = (
    "1 'REXSYS' 1 0.01 200 0 99 0.02 2 0.5 0 0 99 -99 0.03 1 0 0 1 1 0 0 999 -999 0 1 0.8 0.2 0.38 3.14 0.03 4.18 0.1 "
    "{F1IMF} /"
)


@pytest.mark.parametrize(
    ("record", "values", "said"),
    [
        (IEEET4, USUAL, []),
        (IEEET5, USUAL, []),
        (IEEET4, USUAL | {"KV": 5}, ["KV = 5, an error .* in percent\\? Then write 0.05"]),
        (IEEET5, USUAL | {"KV": 5}, ["KV = 5, an error .* in percent\\? Then write 0.05"]),
        (IEEET4, USUAL | {"KR": 1, "KV": 5}, ["KR = 1, .* write 0.01", "KV = 5, .* write 0.05"]),
        (IEEET4, USUAL | {"KR": 0.05, "KV": 0.01}, ["KR = 0.05 above KV = 0.01: .* swapped"]),
        (IEEET4, USUAL | {"TE": 1, "KE": 0.5}, ["TE = 1 s and KE = 0.5, .* exchange them"]),
        (IEEET5, USUAL | {"TE": 1, "KE": 0.5}, ["TE = 1 s and KE = 0.5, .* exchange them"]),
        (IEEET5, USUAL | {"TE": 1.2, "KE": 1}, []),
        (IEEET5, USUAL | {"TE": 1, "KE": -0.05}, []),
        (REXSYS, {"F1IMF": 1}, []),
        (REXSYS, {"F1IMF": 4}, ["F1IMF = 4 above 1: .* v_t is below 0.75 pu"]),
    ],
)
def test_doubtful_values_of_an_exciter_are_asked_about(record, values, said, tmp_path):
    place = tmp_path / "one.dyr"
    place.write_text(f"{GENROU}{record.format(**values)}\n")
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    asked = [doubt.text for doubt in machine_models(read_dyr(place), [machine])[1, "1"].doubts]
    assert len(asked) == len(said), asked
    assert all(re.search(words, text) for words, text in zip(said, asked, strict=True)), asked
