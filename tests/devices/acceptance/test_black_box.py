"""FMUs of others as black boxes: the same device through different ports has one admittance and one verdict."""

import numpy as np
import pytest

from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.face.api.admittance import Admittance
from orchestrator.studies.black_box.bench import Bench
from orchestrator.studies.black_box.fitting import fit
from orchestrator.studies.black_box.frequency_response import Excitation, measure
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.certification.study import certify
from orchestrator.studies.points.executor import Serial

EXCITATION = Excitation("pulse", lowest_hz=0.5, lines=50)


def admittance(gallery, name):
    description = bound_fmu(*gallery(name))
    bench = Bench(description, {"P_0": 0.5, "S_n": 1500.0}, np.array([1.0, 0.0]), isolated=False)
    return measure(bench, EXCITATION)


@pytest.mark.slow
def test_a_port_of_powers_in_si_units_gives_the_same_admittance(gallery):
    plain, powers = (
        admittance(gallery, "converter_without_state"),
        admittance(gallery, "converter_power_si"),
    )
    assert not bound_fmu(*gallery("converter_without_state")).can_save_state
    difference = np.linalg.norm(plain.values - powers.values, axis=(1, 2)) / np.linalg.norm(
        plain.values, axis=(1, 2)
    )
    assert difference.max() < 1e-3
    content = Admittance(plain, 1 + 0j).as_json()
    assert content["lines"] == len(plain.values)
    assert content["model"]["order"] == len(fit(plain).poles)
    slow = [pole for pole in fit(powers).poles if 0.1 < abs(pole.imag) < 100]
    assert slow
    assert min(abs(fit(plain).poles - slow[0])) < 0.05 * abs(slow[0])


@pytest.mark.slow
def test_direct_feedthrough_is_measured_without_a_step(gallery):
    plain, shunted = (
        admittance(gallery, "converter_without_state"),
        admittance(gallery, "converter_feedthrough"),
    )
    assert not plain.feedthrough.any()
    assert np.abs(shunted.feedthrough).max() > 0.01
    assert (
        np.abs(shunted.strictly_proper - plain.strictly_proper).max()
        < 0.05 * np.abs(plain.values).max()
    )


@pytest.mark.nightly
@pytest.mark.slow
def test_a_vendors_black_box_is_certified_and_does_something_to_the_modes(gallery, tmp_path):
    fmu, binding = gallery("converter_power_si")
    result = certify(CertificationRequest(fmu, binding, reactances=(0.3,)), Serial(), tmp_path)
    assert result.verdicts[0].accepted
    assert result.results["with", 0.3].identified is not None
    least = result.verdicts[0].modes[0]
    assert least.damping_percent == pytest.approx(36.4, abs=0.5)  # without the converter: 13.8 %
    assert "converter" in least.components
