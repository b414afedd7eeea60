"""A solved file's VM beside VS: machines at a limit of reactive power, and those within their limits."""

import cmath

import numpy as np
import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from tests.cases.networks.psse import raw, records
from tests.cases.networks.test_network_sources import solved

MACHINE = 3
MORE = 0.05  # that the machine's setpoint differs from what it holds [pu]


@pytest.fixture
def data_of(tmp_path):
    """Records of the WSCC system → its data."""

    def read(found):
        (tmp_path / "grid.raw").write_text(raw(33, found), encoding="utf-8")
        return network_data(NetworkTable(raw="grid.raw"), tmp_path)

    return read


@pytest.fixture
def solution(data_of):
    return solved(data_of(records(33)))


def solved_records(solution, *, setpoint, limits=lambda q: (-300.0, 300.0)):
    """Records with the solution's voltages and powers, and another setpoint [pu] and limits [Mvar] of one machine."""
    found = records(33)
    for k, row in enumerate(found["BUS"]):
        fields = row.split(",")
        v = solution.voltages[f"bus_{fields[0]}"]
        fields[7:9] = f"{abs(v):.9f}", f"{np.degrees(cmath.phase(v)):.9f}"
        found["BUS"][k] = ",".join(fields)
    for k, row in enumerate(found["GENERATOR"]):
        fields = row.split(",")
        q = 100.0 * solution.powers[f"ubus_{fields[0]}"].imag
        fields[3] = f"{q:.6f}"
        if fields[0] == str(MACHINE):
            least, most = limits(q)
            fields[4:7] = f"{most:.6f}", f"{least:.6f}", f"{setpoint:.6f}"
        found["GENERATOR"][k] = ",".join(fields)
    return found


@pytest.mark.parametrize(
    ("more", "limits"),
    [
        (MORE, lambda q: (-300.0, q)),
        (-MORE, lambda q: (q, 300.0)),
        (MORE, lambda q: (q, q)),
        (-MORE, lambda q: (q, q)),
    ],
    ids=["at most", "at least", "fixed, below", "fixed, above"],
)
def test_a_machine_at_its_limit_holds_what_the_solution_has(data_of, solution, more, limits):
    held = abs(solution.voltages[f"bus_{MACHINE}"])
    data = data_of(solved_records(solution, setpoint=held + more, limits=limits))
    assert ["as QG is at a limit" in change.text for change in data.changes] == [True]
    again = solved(data)
    for bus, v in solution.voltages.items():
        assert again.voltages[bus] == pytest.approx(v, abs=1e-7)


@pytest.mark.parametrize("more", [MORE, -MORE, 5e-4])
def test_a_setpoint_that_the_solution_does_not_hold_is_asked_about(data_of, solution, more):
    """PSS/E starts its dynamics from VM, also if nothing kept the machine from VS."""
    held = abs(solution.voltages[f"bus_{MACHINE}"])
    data = data_of(solved_records(solution, setpoint=held + more))
    assert ["with Q within its limits: it holds VM" in change.text for change in data.changes] == [
        True
    ]
    assert abs(solved(data).voltages[f"bus_{MACHINE}"]) == pytest.approx(held, abs=1e-7)


def test_a_machine_at_its_limit_of_a_file_that_is_not_solved_holds_its_setpoint(data_of, solution):
    """QG = QT stands in many files that nobody has solved."""
    found = solved_records(solution, setpoint=1.03, limits=lambda q: (q, q))
    found["BUS"] = records(33)["BUS"]
    assert abs(solved(data_of(found)).voltages[f"bus_{MACHINE}"]) == pytest.approx(1.03, abs=1e-6)


def test_a_machine_whose_power_does_not_fit_the_voltages_holds_its_setpoint(data_of, solution):
    found = solved_records(solution, setpoint=1.03, limits=lambda q: (q, q))
    for k, row in enumerate(found["GENERATOR"]):
        fields = row.split(",")
        if fields[0] == str(MACHINE):
            fields[3:6] = "40", "40", "40"
        found["GENERATOR"][k] = ",".join(fields)
    assert abs(solved(data_of(found)).voltages[f"bus_{MACHINE}"]) == pytest.approx(1.03, abs=1e-6)
