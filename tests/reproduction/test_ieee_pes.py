"""Benchmarks of the IEEE PES for small-signal stability beside a second computation that shares nothing with gfor."""

import shutil

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases import case as cases

FOLDER = cases.BUILT_IN
SECOND = {
    ("impedance", "exact"): ((0.3235, -7.64), (1.2224, 1.49), (1.4271, 7.99)),
    ("impedance", "psse"): ((0.3257, -5.33), (1.2341, 1.80), (1.4337, 7.80)),
    ("impedance", "andes"): ((0.3252, -7.79), (1.2341, 1.07), (1.4347, 7.22)),
    ("power", "exact"): ((0.4012, -2.22), (1.2133, 1.33), (1.4271, 7.99)),
    ("power", "psse"): ((0.4018, -0.12), (1.2232, 1.85), (1.4337, 7.80)),
    ("power", "andes"): ((0.4018, -2.13), (1.2230, 1.10), (1.4347, 7.22)),
}
"""Frequency [Hz] and damping [%] of the three machines at an infinite bus: against it, of machine 3, of 1 against 2."""
NEAR_HZ, NEAR_POINTS = 0.005, 0.1


def modes(name, scenario, folder, load="impedance", like="psse"):
    """Frequencies [Hz] and dampings [%] of a built-in case with another load model and convention."""
    shutil.copytree(FOLDER / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    file = folder / name / "case.toml"
    text = file.read_text(encoding="utf-8")
    for ours, wanted in (('like = "psse"', f'like = "{like}"'), ('"impedance"', f'"{load}"')):
        assert ours in text
        text = text.replace(ours, wanted)
    file.write_text(text, encoding="utf-8")
    found = gfor.load(file).scenario(scenario).modes()
    values = [mode.eigenvalue for mode in found]
    return [(x.imag / (2 * np.pi), -100 * x.real / abs(x)) for x in values]


@pytest.mark.parametrize(("load", "like"), SECOND)
def test_three_machines_at_an_infinite_bus(load, like, tmp_path):
    found = modes("threemachine", "base", tmp_path, load, like)
    for frequency, damping in SECOND[load, like]:
        f, d = min(found, key=lambda one: abs(one[0] - frequency) + abs(one[1] - damping))
        assert f == pytest.approx(frequency, abs=NEAR_HZ)
        assert d == pytest.approx(damping, abs=NEAR_POINTS)


def test_the_brazilian_equivalent_needs_its_stabilisers(tmp_path):
    f, d = min(modes("brazil7", "pss", tmp_path / "with"), key=lambda one: one[1])
    assert f == pytest.approx(0.83, abs=NEAR_HZ)
    assert d == pytest.approx(6.55, abs=0.01)
    f, d = min(modes("brazil7", "no_pss", tmp_path / "without"), key=lambda one: one[1])
    assert 0.846 < f < 0.889
    assert -16 < d < -9
