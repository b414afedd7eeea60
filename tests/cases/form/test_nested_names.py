"""A scenario's names may be written without quotes, as a parameter file's may."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.form.test_case_files import THREE_BUSES


def case(tmp_path, scenario):
    path = tmp_path / "three.toml"
    path.write_text(THREE_BUSES + scenario, encoding="utf-8")
    return load_case(path)


@pytest.mark.parametrize(
    "scenario",
    [
        '[scenarios.long]\nset = { "vsc.pod_p.K" = 150.0, "grid.X_l12" = 0.05 }\n',
        "[scenarios.long]\nset = { vsc.pod_p.K = 150.0, grid.X_l12 = 0.05 }\n",
        "[scenarios.long.set]\nvsc.pod_p.K = 150.0\ngrid.X_l12 = 0.05\n",
        "[scenarios.long]\nset.vsc.pod_p.K = 150.0\nset.grid.X_l12 = 0.05\n",
    ],
)
def test_quoted_and_unquoted_names_mean_the_same(scenario, tmp_path):
    assert case(tmp_path, scenario).scenarios["long"].set == {
        "vsc.pod_p.K": 150.0,
        "grid.X_l12": 0.05,
    }


def test_a_wrong_value_of_an_unquoted_name_is_one_problem_about_it(tmp_path):
    with pytest.raises(CaseError) as found:
        case(tmp_path, "[scenarios.long]\nset = { vsc.pod_p.KK = 150.0 }\n").prepare()
    (problem,) = found.value.problems
    assert "no variable 'pod_p.KK'" in str(problem)
    assert "there is no scenario" not in str(found.value)
