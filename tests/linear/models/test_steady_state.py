"""Operating points: verified where the power flow gives them, solved for where it does not."""

import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models import steady_state
from orchestrator.linear.models.steady_state import begin_at, find_operating_point
from orchestrator.systems.coupling.master import Master
from tests.support.scenarios import prepare_one


def master_of(scenario="gfor", change=None):
    ready = prepare_one("two_area", scenario)
    if change:
        for key, value in change.items():
            component, _, variable = key.partition(".")
            parameters = ready.system.components[component].parameters
            parameters[variable] = parameters[variable] + value
    return Master(ready.system, ready.schedule, ready.step_size)


@pytest.mark.parametrize("scenario", ["base", "gfor", "pod_p", "pod_q", "pod_pq"])
def test_the_power_flow_gives_the_coupled_steady_state(scenario):
    with master_of(scenario) as master:
        point = find_operating_point(master)
        assert point.iterations == 0
        assert point.residual < 1e-13
        master.advance(1000)
        assert find_operating_point(master).residual < 1e-12


def test_a_wrong_start_is_moved_to_the_fixed_point_even_of_an_unstable_system():
    # an angle that does not belong to the network's voltages: everything moves at first
    with master_of("base", {"sg2.theta_0": 0.05}) as master:
        point = find_operating_point(master)
        assert point.initial_residual > 1e-5
        assert point.iterations >= 1
        assert point.residual < 1e-12
        assert find_operating_point(master).iterations == 0


@pytest.mark.parametrize(("off", "is_begun_at"), [(0.0, True), (0.1, False)])
def test_a_known_point_is_begun_at_where_less_moves_there(off, is_begun_at):
    changed = {"sg2.theta_0": 0.05}
    with master_of("base", changed) as master:
        known = find_operating_point(master).states
    with master_of("base", changed) as master:
        begin_at(master, {name: value + off for name, value in known.items()})
        assert (find_operating_point(master).iterations == 0) is is_begun_at


# of the direction that one size of perturbation gives
@pytest.mark.parametrize("worth", [-1.0, 0.3])
def test_a_direction_that_a_limit_spoils_is_taken_anew(worth, monkeypatch):
    exact = steady_state._newton_correction

    def spoilt(*arguments, once):
        return exact(*arguments, once=once) * (worth if once else 1.0)

    monkeypatch.setattr(steady_state, "_newton_correction", spoilt)
    with master_of("base", {"sg2.theta_0": 0.05}) as master:
        assert find_operating_point(master).residual < 1e-12


def test_where_power_does_not_balance_at_rated_frequency_there_is_no_fixed_point():
    with (
        master_of("gfor", {"sg1.P_0": -0.2}) as master,
        pytest.raises(AnalysisError, match="no steady state") as error,
    ):
        find_operating_point(master)
    assert "generation and load" in str(error.value)


def test_the_error_says_where_a_models_author_looks_first():
    """The start values of the component that moves; no Newton iteration is counted where none helped."""
    with master_of("base", {"sg2.theta_0": 0.05}) as master, pytest.raises(AnalysisError) as error:
        find_operating_point(master, max_iterations=0)
    said = str(error.value)
    assert "0 Newton iterations" not in said
    assert said.index("start values of the component") < said.index("generation and load balance")
