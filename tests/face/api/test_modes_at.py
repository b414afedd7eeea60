"""Modes with other values on FMUs that stay open: the same to the last bit, and less work."""

import copy
import pickle

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.linear.models import blocks

POINTS = (
    {"gfor.pod_p.K": 150.0},
    {"gfor.pod_p.K": 150.0, "gfor.pod_p.T_S1": 0.2},
    {"grid.X_L": 0.13},
    {"gfor.pod_p.enabled": False},
    {"gfor.pod_p.K": 150.0},
    {},
)


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area")


@pytest.fixture
def scenario(case):
    with case.scenario("pod_p") as opened:
        yield opened


def test_the_result_is_the_same_to_the_last_bit(case, scenario):
    for values in POINTS:
        kept, fresh = scenario.modes_at(values), case.scenario("pod_p", values).modes()
        assert kept.as_json() == fresh.as_json()
        assert kept.warnings == fresh.warnings
        assert np.array_equal(kept.eigenvalues, fresh.eigenvalues)
        assert np.array_equal(kept.result.model.A, fresh.result.model.A)
        assert kept.result.operating_point == fresh.result.operating_point
        assert kept.dataset.identical(fresh.dataset)


@pytest.fixture
def opened(monkeypatch):
    """The names of the components whose FMUs were unpacked and loaded, in turn."""
    names, begin = [], LoadedComponent.__init__

    def counted(self, name, *given, **named):
        names.append(name)
        begin(self, name, *given, **named)

    monkeypatch.setattr(LoadedComponent, "__init__", counted)
    return names


def test_each_fmu_is_opened_once_for_all_evaluations(case, scenario, opened):
    for values in POINTS:
        scenario.modes_at(values)
    assert sorted(opened) == sorted(scenario.prepared.system.components)
    for values in POINTS[:2]:
        case.scenario("pod_p", values).modes()
    assert len(opened) == 3 * len(scenario.prepared.system.components)


def test_components_that_a_value_leaves_as_they_are_keep_their_linear_models(scenario, monkeypatch):
    linearised, remembered = [], blocks.remembered

    def counted(master, name, asked, linearized):
        return remembered(master, name, asked, lambda: linearised.append(name) or linearized())

    monkeypatch.setattr(blocks, "remembered", counted)
    scenario.modes_at()
    assert {*linearised} == {*scenario.prepared.system.components}
    linearised.clear()
    scenario.modes_at({"gfor.pod_p.K": 150.0})
    assert {*linearised} == {"gfor"}


def test_a_wrong_value_leaves_the_scenario_usable(scenario):
    with pytest.raises(gfor.CosimError, match=r"no variable 'pod_p\.KK'"):
        scenario.modes_at({"gfor.pod_p.KK": 1.0})
    assert scenario.modes_at({"gfor.pod_p.K": 100.0}).stability.stable
    scenario.close()
    scenario.close()
    assert scenario.modes_at().stability.stable


def test_where_there_is_no_steady_state_the_fmus_stay_open(case, scenario, opened):
    """An optimiser tries such points; what it finds after them is what it would find without them."""
    before = scenario.modes_at({"gfor.pod_p.K": 100.0})
    with pytest.raises(gfor.CosimError, match="steady state"):
        scenario.modes_at({"sg1.governor.delta_P_ref": 0.1})
    for values in ({"gfor.pod_p.K": 100.0}, {"gfor.pod_p.K": 150.0}):
        after, fresh = scenario.modes_at(values), case.scenario("pod_p", values).modes()
        assert np.array_equal(after.eigenvalues, fresh.eigenvalues)
        assert np.array_equal(after.result.model.A, fresh.result.model.A)
    assert np.array_equal(before.eigenvalues, scenario.modes_at({"gfor.pod_p.K": 100}).eigenvalues)
    assert len(opened) == 3 * len(scenario.prepared.system.components)


def test_copies_have_no_open_fmus(scenario):
    whole = scenario.modes_at()
    for other in (copy.deepcopy(scenario), pickle.loads(pickle.dumps(scenario))):
        assert other._bench is None
        assert np.array_equal(other.modes().eigenvalues, whole.eigenvalues)
