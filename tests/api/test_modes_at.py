"""Modes with other values on FMUs that stay open: the same to the last bit, and less work."""

import copy
import pickle
import time

import numpy as np
import pytest

import orchestrator as gfor

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


def test_an_evaluation_takes_less_than_a_fresh_one(case, scenario):
    def spent(evaluate):
        begin = time.process_time()
        for k in range(4):
            evaluate({"gfor.pod_p.K": 150.0 + k})
        return time.process_time() - begin

    scenario.modes_at()
    case.scenario("pod_p").modes()
    assert spent(scenario.modes_at) < 0.7 * spent(
        lambda values: case.scenario("pod_p", values).modes()
    )


def test_a_wrong_value_leaves_the_scenario_usable(scenario):
    with pytest.raises(gfor.CosimError, match=r"no variable 'pod_p\.KK'"):
        scenario.modes_at({"gfor.pod_p.KK": 1.0})
    assert scenario.modes_at({"gfor.pod_p.K": 100.0}).stability.stable
    scenario.close()
    scenario.close()
    assert scenario.modes_at().stability.stable


def test_copies_have_no_open_fmus(scenario):
    whole = scenario.modes_at()
    for other in (copy.deepcopy(scenario), pickle.loads(pickle.dumps(scenario))):
        assert other._bench is None
        assert np.array_equal(other.modes().eigenvalues, whole.eigenvalues)
