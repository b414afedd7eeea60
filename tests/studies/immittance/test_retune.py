"""What to retune: functions of a parameter from few scans, against eigenvalues of closed systems that are known."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from orchestrator.core.errors import AnalysisError
from orchestrator.studies.immittance.judgement import judge_loop
from orchestrator.studies.immittance.loop import CutLoop
from orchestrator.studies.immittance.retune import Retuned, Tunable, retune
from orchestrator.studies.immittance.sides import Sampled
from orchestrator.studies.immittance.strength import SourceBehind, strengths_of
from tests.studies.immittance.plants import OMEGA, Line, constant_power, eigenvalues, is_stable

F = np.geomspace(0.1, 1000, 300)
WEAK = Line(0.05, 1.2 / OMEGA)


def plant(g=1.2, T=0.003):
    return constant_power(g=g, h=0.6, T=T, G=0.2)


def judged(device, line):
    sides = (
        Sampled("scan", F, M, np.zeros(len(F))) for M in (device.admittance(F), line.impedance(F))
    )
    loop = CutLoop(*sides)
    request = SimpleNamespace(frequency=50.0, device=None)
    return SimpleNamespace(
        loop=loop, judgement=(j := judge_loop(loop)), request=request, verdict=j.verdict, cut=None
    )


def followed(name, now, low, high, goal=0.2, study=None):
    study = study or (lambda values: judged(plant(**values), WEAK))
    return retune(study, Tunable(name, "1", now, low, high), study({name: now}), goal)


@pytest.fixture(scope="module")
def over_g():
    return followed("g", 1.2, 0.3, 2.4)


def test_the_limit_is_that_of_the_eigenvalues_to_a_thousandth(over_g):
    found = over_g
    assert len(found.scans) <= 8
    growth = lambda x: eigenvalues(plant(g=x), WEAK).real.max()  # noqa: E731
    d = found.distances
    k = int(np.flatnonzero((d[:-1] < 0) != (d[1:] < 0))[0])
    told = found.values[k] - d[k] * (found.values[k + 1] - found.values[k]) / (d[k + 1] - d[k])
    assert told == pytest.approx(brentq(growth, *found.values[[k, k + 1]]), rel=1e-3)
    assert [x > 0 for x in d] == [bool(growth(x) < 0) for x in found.values]


def test_what_is_needed_is_enough_and_was_foretold(over_g):
    found = over_g
    assert not is_stable(plant(), WEAK)
    assert is_stable(plant(g=found.needed), WEAK)
    exact = judged(plant(g=found.needed), WEAK).judgement.margins.distance.value
    assert exact >= 0.2
    assert found.predicted.distance == pytest.approx(exact, abs=1e-3)
    assert all(
        abs(c.found - c.predicted) < max(2 * c.expected_error, 0.01) for c in found.checks[-3:]
    )


@pytest.mark.slow
def test_modes_and_the_network_s_limit_are_those_of_the_eigenvalues(over_g):
    told = [x for x in zip(over_g.values, over_g.figures, strict=True) if x[1].mode is not None]
    assert len(told) > 10
    for value, figures in told[::10]:
        modes = eigenvalues(plant(g=value), WEAK)
        near = modes[np.argmin(abs(modes - figures.mode))]
        assert figures.mode == pytest.approx(near, rel=0.02)
        weaker = lambda k: replace(WEAK, R=k * WEAK.R, L=k * WEAK.L)  # noqa: E731
        if math.isfinite(figures.weaker):
            assert is_stable(plant(g=value), weaker(0.995 * figures.weaker))
            assert not is_stable(plant(g=value), weaker(1.005 * figures.weaker))


def test_a_scan_that_is_not_what_the_others_say_is_seen():
    """The device jumps at g = 0.8: no function follows it, and the error says so."""
    found = followed(
        "g", 1.2, 0.3, 2.4, study=lambda v: judged(plant(g=v["g"] - 0.25 * (v["g"] < 0.8)), WEAK)
    )
    assert any(not abs(c.found - c.predicted) < 0.02 for c in found.checks)
    assert (
        found.needed is None
        or judged(plant(g=found.needed - 0.25 * (found.needed < 0.8)), WEAK).verdict == "stable"
    )


def test_a_range_that_cannot_be_scanned_is_cut_and_said():
    def study(values):
        if values["g"] > 2.0:
            raise AnalysisError("it runs away")
        return judged(plant(**values), WEAK)

    found = followed("g", 1.2, 0.3, 2.4, study=study)
    assert found.setting.high < 2.0
    assert "it runs away" in found.remark
    assert found.needed is not None


def test_a_parameter_without_effect_is_named():
    found = followed("x", 1.0, 0.5, 2.0, study=lambda v: judged(plant(), WEAK))
    assert (found.remark, found.figures) == ("changes nothing at the cut", [])
    assert isinstance(found, Retuned)


def test_a_source_of_a_short_circuit_ratio_is_the_line_of_its_impedance():
    source = SourceBehind("a source", 0.05, 1.2, OMEGA)
    s = 2j * np.pi * F
    assert np.allclose(source.at(s), WEAK.impedance(F))
    assert strengths_of(source, 50.0, 100.0, None, "")[0] == pytest.approx(100 / abs(0.05 + 1.2j))
    machine = SimpleNamespace(
        is_exact=True, at=lambda s: source.at(s) * (1 + 9 / (1 + s))[:, None, None]
    )
    assert strengths_of(machine, 50.0, 100.0, None, "")[0] is None
