"""Records of exciters, stabilisers and a compensator beside ANDES: eigenvalues of one machine at an infinite bus."""

import json

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from tests.benchmarks import andes_records as andes
from tests.models.one_machine import Network, OneMachine

PEER = json.loads(andes.PLACE.read_text("utf-8"))
DEVIATION = 5e-4  # of each eigenvalue's size, and of 1 rad/s
MOST = 0.3  # percent of the swing of a run


def network():
    """The line between both buses; the machine's angle is that of its power."""
    Z, (v_1, v_2) = complex(andes.R, andes.X), andes.VOLTAGES
    angles = np.linspace(0, 0.8, 400001)
    ends = v_2 * np.exp(1j * angles)
    power = (ends * np.conj((ends - v_1) / Z)).real
    angle = np.interp(andes.POWER, power, angles)
    return Network({1: v_1 + 0j, 2: v_2 * np.exp(1j * angle)}, ((1, 2, Z),), infinite=1, machine=2)


def machine(records, folder):
    """The machine with ANDES' records, as DYR records."""
    lines = [f"2 GENROU 1 {andes.MACHINE} /"]
    for record in records:
        kind, *given = record.split()
        lines.append(f"2 {kind} 1 {' '.join(pair.split('=')[1] for pair in given)} /")
    return OneMachine(
        "\n".join(lines), folder, network(), rating=andes.RATING, source=0.25j, torque=True
    )


@pytest.mark.parametrize("name", andes.RECORDS)
def test_its_eigenvalues_are_those_of_andes(name, tmp_path):
    alone = machine(andes.RECORDS[name], tmp_path)
    ours = np.array([z for z in alone.eigenvalues() if z.imag >= -1e-9])
    wanted = np.array([complex(*pair) for pair in PEER["modes"][name]])
    distance = np.abs(ours[:, None] - wanted) / (1 + np.abs(wanted))
    rows, columns = linear_sum_assignment(distance)
    assert max(distance[rows, columns]) < DEVIATION
    assert len(columns) == len(wanted)


@pytest.mark.parametrize("name", andes.RUNS)
def test_its_voltage_after_a_step_of_the_reference_is_that_of_andes(name, tmp_path):
    alone = machine(andes.RUNS[name], tmp_path)
    step = {"exciter.delta_V_ref": andes.STEP_OF_REFERENCE}
    rows = alone.run(alone.network.lines, andes.UNTIL, 0.0, andes.EVERY, step)
    ours, wanted = np.array([abs(buses[2]) for _, _, buses in rows]), np.array(PEER["runs"][name])
    assert 100 * np.abs(ours - wanted).max() / (np.ptp(wanted) / 2) < MOST
