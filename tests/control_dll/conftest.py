"""The converter's control as DLLs, written once, and what they are driven with."""

import numpy as np
import pytest

from fmus.control_dll.export import control_part_of, write_dll
from tests.control_dll.hosts import STEP

PODS = {"pod_p.enabled": 1, "pod_q.enabled": 1, "pod_q.N_S": 3}


@pytest.fixture(scope="session")
def part():
    return control_part_of("gfor")


@pytest.fixture(scope="session")
def written(part, tmp_path_factory):
    """What was written for a platform, a sample time and other defaults; each once."""
    kept = {}

    def write(platform="linux64", sample_time=STEP, **values):
        key = platform, sample_time, tuple(values.items())
        if key not in kept:
            folder = tmp_path_factory.mktemp("dll")
            kept[key] = write_dll(part, folder, (platform,), sample_time, values)
        return kept[key]

    return write


@pytest.fixture(scope="session")
def drive():
    """Measured values that move every state: noise, a third harmonic, a zero sequence, a jump."""
    rng, rows = np.random.default_rng(7), 3000
    time = np.arange(rows) * STEP
    volt, ampere = 230 * np.sqrt(2 / 3), 1500 / 230 * np.sqrt(2 / 3)
    angle = 2 * np.pi * 50 * time + np.where(time > 0.03, -0.4, 0.0)
    signals = []
    for amplitude, lag in ((volt, 0.1), (0.9 * ampere, 0.2), (0.9 * ampere, 0.1)):
        for phase in range(3):
            wave = np.cos(angle + lag - 2 * np.pi / 3 * phase) + 0.05 * np.cos(3 * angle) + 0.02
            signals.append(amplitude * (wave + 0.05 * rng.standard_normal(rows)))
    return np.array(signals).T
