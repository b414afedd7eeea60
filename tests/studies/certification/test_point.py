"""One point of the norm's study."""

import numpy as np

from orchestrator.studies.certification.case_file import BASE
from orchestrator.studies.certification.point import FREQUENCY, CertificatePointTask, compute_point
from orchestrator.studies.points.task import StudyCase
from tests.support.scenarios import prepare_one


def test_the_frequency_at_bus_2_is_that_of_the_network(tmp_path):
    """The rated frequency that is set counts, and not the one that the machine's FMU declares."""
    text = BASE.read_text(encoding="utf-8").replace('stop_time = "61 s"', 'stop_time = "1.1 s"')
    path = tmp_path / "case.toml"
    path.write_text(text.replace("[network]", "[network]\nfrequency = 60"), encoding="utf-8")
    result = compute_point(CertificatePointTask(StudyCase.of(prepare_one(path, "without")), 0.1))
    assert not result.failure
    assert np.allclose(result.signals[FREQUENCY], 60.0, atol=1e-3)
