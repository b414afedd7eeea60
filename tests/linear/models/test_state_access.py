"""The linear model inside an FMU is used where the FMU is at its operating point, and has its parameters."""

from types import SimpleNamespace

import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.state_access import check_operating_point

MODEL = SimpleNamespace(
    states={"x": 0.2}, inputs={"u": 1.0}, outputs={"y": 50.0}, parameters={"K": 3.0}
)
STARTS = {"K": 3.0, "R": 0.05, "title": "a device"}


def running(**values):
    """A component with the model's figures, and its parameters' starts; some differ."""
    found = {"x": 0.2, "u": 1.0, "y": 50.0, "K": 3.0, "R": 0.05} | values
    description = SimpleNamespace(
        states=("x",),
        parameters=tuple(STARTS),
        variables={name: SimpleNamespace(start=STARTS.get(name)) for name in (*found, "title")},
    )
    return SimpleNamespace(
        name="gfor",
        description=description,
        values=lambda names: {name: found[name] for name in names},
    )


@pytest.mark.parametrize("values", [{}, {"x": 0.2 + 0.9e-6}, {"y": 50.0 * (1 + 0.9e-6)}])
def test_a_model_of_this_point_is_used(values):
    check_operating_point(running(**values), MODEL)


@pytest.mark.parametrize(
    "values",
    [
        {"x": 0.2 + 1.1e-6},
        {"u": 1.0 - 1.1e-6},
        {"y": 50.0 * (1 + 1.1e-6)},
        {"K": 3.1},
        {"R": 0.06},
        {"x": float("nan")},
    ],
)
def test_a_model_of_another_point_or_of_other_parameters_is_not(values):
    (name,) = values
    with pytest.raises(AnalysisError, match=f"is of another operating point: {name} is "):
        check_operating_point(running(**values), MODEL)


def test_a_model_of_another_fmu_is_not():
    of_other_states = SimpleNamespace(**{**vars(MODEL), "states": {"x_d": 0.2}})
    with pytest.raises(AnalysisError, match="has other states than the FMU"):
        check_operating_point(running(), of_other_states)
    of_another_parameter = SimpleNamespace(**{**vars(MODEL), "parameters": {"T": 1.0}})
    with pytest.raises(AnalysisError, match="speaks of 'T', which the FMU does not have"):
        check_operating_point(running(), of_another_parameter)
