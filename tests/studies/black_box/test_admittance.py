"""The converter's admittance through FMI alone, against its equations."""

import numpy as np
import pytest
from rich.console import Console

from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.face.cli import admittance as command
from orchestrator.face.cli.admittance import _summary
from orchestrator.studies.black_box.fitting import fit
from orchestrator.studies.black_box.frequency_response import Excitation, measure
from tests.studies.black_box import boxes


def relative(found, exact):
    return np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))


def test_a_short_range_with_and_without_saved_states():
    """From 2 Hz up the periods are short; saving and restoring must make no difference."""
    found = {}
    for restore in (True, False):
        bench = boxes.bench_of("gfor", restore=restore)
        found[restore] = measure(bench, Excitation(lowest_hz=2.0, lines=40, settled=1e-4))
        assert not found[restore].feedthrough.any()
    assert (
        np.abs(found[True].values - found[False].values).max()
        < 1e-9 * np.abs(found[True].values).max()
    )
    exact = boxes.response(boxes.runge_kutta("gfor"), found[True].frequencies)
    assert relative(found[True].values, exact).max() < 1e-4
    assert (
        relative(
            found[True].values, boxes.response(boxes.held("gfor"), found[True].frequencies)
        ).max()
        < 0.01
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", ["multisine", "pulse"])
def test_from_a_twentieth_of_a_hertz_to_a_kilohertz(method):
    """Within 1 % of the exact response everywhere; and as close as its bounds say to that of the FMU's integrator."""
    measured = measure(boxes.bench_of("pod_pq"), Excitation(method))
    assert measured.frequencies[0] == pytest.approx(0.05)
    assert measured.frequencies[-1] == pytest.approx(1000, abs=0.1)
    exact = boxes.response(boxes.held("pod_pq"), measured.frequencies)
    assert relative(measured.values, exact).max() < 0.01
    for i in range(2):  # not only the matrix: every element of it
        for j in range(2):
            error = np.abs(measured.values[:, i, j] / exact[:, i, j] - 1)
            assert error.max() < 0.01
    computed = boxes.response(boxes.runge_kutta("pod_pq"), measured.frequencies)
    assert relative(measured.values, computed).max() < 1e-4
    # what rounding leaves of the Jacobians and of the outputs
    floor = 1e-8 * np.abs(measured.values).max()
    assert (np.abs(measured.values - computed) <= measured.bounds + floor).mean() > 0.95
    model = fit(measured)
    assert len(model.A) <= 27
    assert relative(model.response(measured.z), exact).max() < 0.01


def test_amplitudes_that_leave_the_linear_range_show_in_the_bounds():
    """Products of current and voltage grow with the square of the amplitude: the bound must say so."""
    small, large = (
        measure(boxes.bench_of("gfor"), Excitation(lowest_hz=5.0, lines=20, amplitude=a))
        for a in (1e-3, 0.03)
    )
    error = np.abs(large.values - small.values)
    assert large.largest_bound > 5 * small.largest_bound
    assert large.nonlinearity / small.nonlinearity == pytest.approx(30**2, rel=0.1)
    assert not small.warnings
    assert (error <= 2 * large.bounds + 1e-6 * np.abs(small.values)).mean() > 0.5


def test_what_the_communication_points_cannot_show_is_refused():
    with pytest.raises(AnalysisError, match="cannot be seen at communication points"):
        measure(boxes.bench_of("gfor"), Excitation(lowest_hz=5.0, highest_hz=6000.0))


def test_a_device_that_never_comes_to_rest_is_refused():
    bench = boxes.bench_of("gfor", longest_wait=2.0)
    # not where it is held
    bench.parameters = dict(bench.parameters) | {"P_0": 0.9, "Q_0": 0.0, "theta_0": 0.3}
    with pytest.raises(AnalysisError, match="alone at an ideal bus its current still moves"):
        measure(bench, Excitation(lowest_hz=5.0, lines=10))


def test_the_summary_begins_with_its_heading(capsys):
    model = {"order": 2, "error": 1e-3, "poles": [{"real": -1.0, "imag": 2 * np.pi}]}
    content = {
        "method": "noise",
        "lines": 9,
        "range_hz": [1, 9],
        "largest_relative_bound": 0.1,
        "model": model,
    }
    Console(width=200).print(_summary(content))
    shown = capsys.readouterr().out
    assert (
        -1
        < shown.index("9 lines from 1 to 9 Hz")
        < shown.index("Poles of the fitted model")
        < shown.index("15.72")
    )


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "measured"),
        (("--scan", "s.txt"), "a scan is in siemens; give the rated voltage as well"),
        (("--scan", "s.txt", "--voltage", "230 kV"), "measured"),
        (("--voltage", "230 kV"), "measured"),
    ],
)
def test_a_rated_voltage_is_needed_for_a_scan_alone(words, reason, gfor, tmp_path, monkeypatch):
    """The answer is in per unit; a scan has no base that could be stated in it."""

    def measure(*_):
        raise InputError("it is measured")

    monkeypatch.setattr(command, "_measured", measure)
    code, _, error = gfor("fmu", "admittance", tmp_path / "a.fmu", *words, "--out", tmp_path / "o")
    assert code == 2
    assert reason in " ".join(error.split())
