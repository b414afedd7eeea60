"""LCFB1 in dynamics data: its fields, the governor that it is around, and a case that gives back what it took over."""

import pytest

from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.core.errors import InputError

GENROU = "1 'GENROU' 1 8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /\n"
TGOV1 = "1 'TGOV1' 1 0.05 0.5 1 0 2.1 7 0 /\n"
DEGOV = "1 'DEGOV' 1 0.2 0.3 0.5 10 0.02 0.2 0.1 0.024 1.1 0 /\n"
LCFB1 = "1 'LCFB1' 1 1 0 10 5 0.001 0.2 5 2 2.4 /\n"
"""The record of STEPS' file bench/IEEE39.dyr, of the machine at its bus 31."""


def model_of(tmp_path, text, leaving_out=()):
    place = tmp_path / "grid.dyr"
    place.write_text(text)
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    return machine_models(read_dyr(place), [machine], leaving_out)[1, "1"]


@pytest.mark.parametrize("text", [GENROU + TGOV1 + LCFB1, LCFB1 + GENROU + TGOV1])
def test_its_governor_has_it_with_the_fields_in_the_order_of_steps(text, tmp_path):
    model = model_of(tmp_path, text)
    assert model.parts["governor"] == "tgov1_lcfb1"
    assert "supervisor" not in model.parts
    own = {
        name.removeprefix("governor.lcfb1."): value
        for name, value in model.parameters.items()
        if name.startswith("governor.lcfb1.")
    }
    assert own == {
        "frequency_bias": True,
        "power_control": False,
        "F_b": 10,
        "T_pelec": 5,
        "db": 0.001,
        "E_max": 0.2,
        "K_P": 5,
        "K_I": 2,
        "Ir_max": 2.4,
    }


def test_left_out_the_governor_is_as_without_it(tmp_path):
    model = model_of(tmp_path, GENROU + TGOV1 + LCFB1, ["LCFB1"])
    assert model.parts["governor"] == "tgov1"
    assert not [name for name in model.parameters if "lcfb1" in name]


@pytest.mark.parametrize(
    ("text", "whose"),
    [(GENROU + LCFB1, "it has no record of one"), (GENROU + DEGOV + LCFB1, "DEGOV has none")],
)
def test_without_a_reference_to_move_it_is_refused_with_what_goes_on(text, whose, tmp_path):
    with pytest.raises(InputError) as refused:
        model_of(tmp_path, text)
    assert (
        f"LCFB1 moves the power reference of the governor of machine '1' at bus 1, and {whose}"
        in (str(refused.value))
    )
    assert "dyr_leave_out = ['LCFB1']" in str(refused.value)
    model_of(tmp_path, text, ["LCFB1"])


@pytest.mark.parametrize(("flag", "at"), [("FBF", 0), ("PBF", 1)])
def test_a_flag_that_is_none_is_refused(flag, at, tmp_path):
    values = LCFB1.split()
    values[3 + at] = "2"
    with pytest.raises(InputError, match=f"LCFB1 has {flag} = 2"):
        model_of(tmp_path, GENROU + TGOV1 + " ".join(values))
