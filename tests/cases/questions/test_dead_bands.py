"""Dead bands about the operating point are asked about where a loop that acts beyond them is hidden in modes."""

import pytest

from orchestrator.cases.case import load_case
from tests.cases.networks.psse.test_dyr_following import dyr, prepared
from tests.cases.networks.psse.test_dyr_plants import PLANT
from tests.support.mill import mill_case

__all__ = ["prepared"]  # the fixture
WIDE = "0.1 -0.1 -1 1 0.43 -0.43 1 0.05 0.25 -1 1 "
"""emax to fdbd2 of the record, whose dead bands nothing leaves."""

FLAGS = "0 0 1 0.02 18 5 "
"""VCFlag to Ki."""


def asked(prepared, bands, flags=FLAGS):
    Q, f = bands
    plant = PLANT.format("1").replace(WIDE, f"0.1 -0.1 {Q} 0.43 -0.43 1 0.05 0.25 {f} ")
    ready = prepared(dyr(plant=plant.replace(FLAGS, flags)), "")
    return [" ".join(q.text.split()) for q in ready.questions if "dead band" in q.text]


@pytest.mark.parametrize(
    ("Q", "f", "ends"),
    [("-0.01 0.01", "-1 1", ("dbd1", "dbd2")), ("-1 1", "-6e-4 6e-4", ("fdbd1", "fdbd2"))],
)
def test_a_plants_dead_band_is_asked_about_with_the_command_that_shows_its_loop(
    prepared, Q, f, ends
):
    (text,) = asked(prepared, (Q, f))
    assert "so modes are without it" in text
    assert " ".join(f"--set gfor3.plant.{end}=0" for end in ends) in text


@pytest.mark.parametrize(
    ("Q", "f", "flags"),
    [
        ("-1 1", "-1 1", FLAGS),
        ("0 0", "0 0", FLAGS),
        ("0 0.01", "-1 1", FLAGS),
        ("-0.01 0.01", "-1 1", "0 0 1 0.02 0 0 "),
        ("-1 1", "-6e-4 6e-4", "0 0 0 0.02 18 5 "),
    ],
    ids=["never left", "none", "an end at the operating point", "no gain", "no control of power"],
)
def test_a_dead_band_that_hides_no_loop_is_not_asked_about(prepared, Q, f, flags):
    assert asked(prepared, (Q, f), flags) == []


@pytest.mark.parametrize(("FreqFlag", "number"), [(0, 0), (1, 1)])
def test_distributed_generation_is_asked_about_where_it_answers_to_frequency(
    tmp_path, FreqFlag, number
):
    """DER_A has names of a plant's dead band, and another switch."""
    record = (
        f"1 'GENCLS' 1 0 0 /\n2 'DERA1' 1 1 {FreqFlag} 0 1 1 1 0.02 0.02 -99 99 0 0 0.02 0.02 20 20 -0.0006 0.0006 "
        "99 -99 1.1 0 0.5 -0.5 0.02 0.1 10 1.2 0.2 0.85 1.2 1.15 0.16 0.16 0.16 2 0.5 56.5 62 0.16 0.16 0.02 2 0.02 "
        "0.3 1 -1 /\n"
    )
    (ready,) = load_case(mill_case(tmp_path, machines=record)).prepare(["base"])
    texts = [q.text for q in ready.questions if "dead band" in q.text]
    assert len(texts) == number
    assert all("--set gfor2.fdbd1=0 --set gfor2.fdbd2=0" in text for text in texts)
