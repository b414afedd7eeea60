"""Choices of what a scenario is built of: written among the values, and never a value of an FMU."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.build_choices import NativeChoice, layer_of
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.core.errors import CaseError
from tests.support.scenarios import prepare_one


def native(components):
    """Names of those that run without Python: their FMUs give directional derivatives."""
    return {
        name for name, plan in components.items() if plan.description.gives_directional_derivatives
    }


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ({}, set()),
        ({"gfor.native": True}, {"gfor"}),
        ({"sg*.native": True}, {"sg1", "sg2"}),
        ({"*.native": True}, {"sg1", "sg2", "gfor", "grid"}),
        ({"*.native": True, "sg2.native": False}, {"sg1", "gfor", "grid"}),
        ({"sg2.native": False, "*.native": True}, {"sg1", "sg2", "gfor", "grid"}),
    ],
)
def test_a_pattern_chooses_and_the_last_choice_decides(given, found):
    assert native(load_case("two_area").components_of("gfor", given)) == found


def test_a_stronger_layer_decides(tmp_path):
    path = tmp_path / "values.toml"
    path.write_text('[set]\n"*.native" = true\n"gfor.pod_p.K" = 150.0\n', encoding="utf-8")
    components = load_case("two_area").components_of(
        "gfor", {"grid.native": False}, [read_parameter_file(path)]
    )
    assert native(components) == {"sg1", "sg2", "gfor"}
    assert components["gfor"].parameters["pod_p.K"] == 150.0


def test_a_choice_is_no_value_of_the_scenario():
    prepared = prepare_one("two_area", "gfor", {"*.native": True, "grid.X_L": 0.2})
    assert prepared.values["grid.X_L"] == 0.2
    assert not [name for name in prepared.values if name.endswith(".native")]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gfor.native": 1.0}, "--set gfor.native: native = 1.0; it must be true or false"),
        ({"gfor.native": "yes"}, "--set gfor.native: native = 'yes'; it must be true or false"),
        ({"gfr.native": True}, "--set gfr.native: there is no component 'gfr'"),
        # this case has no units
        ({"units.alpha": 0.3}, "--set units.alpha: there is no component 'units'"),
        ({"gfor.alpha": 0.3}, "--set gfor.alpha: component 'gfor' has no variable 'alpha'"),
    ],
)
def test_a_wrong_choice_is_named_with_its_place(given, said):
    with pytest.raises(CaseError) as caught:
        load_case("two_area").components_of("gfor", given)
    assert said in str(caught.value)


def test_a_share_for_one_unit_overrides_the_one_for_all_in_any_order():
    given = {"units.alpha.7": 0.6, "units.alpha": 0.2, "gfor*.pod_p.K": 100.0, "*.native": True}
    layer = layer_of(given, lambda key: f"file, {key}", has_units=True)
    assert [(choice.label, choice.share) for choice in layer.shares] == [("", 0.2), ("7", 0.6)]
    assert layer.natives == (NativeChoice("*", True, "file, *.native"),)
    assert layer.values == {"gfor*.pod_p.K": 100.0}
