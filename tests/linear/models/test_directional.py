"""Native FMUs: modes by perturbation against modes from the FMUs' own directional derivatives."""

import zipfile

import numpy as np
import pytest

from fmus.toolchain import native_fmu
from fmus.toolchain.compiler import host_platform
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.symbols import Function
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.description import read_description
from orchestrator.linear.models.component_linearization import linearize_by_derivatives
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.systems.coupling import small_fmus


@pytest.fixture(params=["base", "pod_pq"])
def prepared(request):
    return prepare_one("two_area", request.param, {"*.native": True})


def farthest(ours, theirs):
    """Largest distance of an eigenvalue from the nearest one on the other side."""
    return np.abs(ours[:, None] - theirs[None]).min(axis=1).max()


def test_the_continuous_systems_are_the_same(prepared):
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        perturbed = eigenvalues(continuous(Blocks(master, without_step=True)))
        exact = eigenvalues(continuous(Blocks(master, without_step=True, directional=True)))
    assert len(exact) == len(perturbed)
    assert farthest(exact, perturbed) < 1e-7 * np.abs(exact).max()
    slow = np.abs(exact) < 2 * np.pi * 5
    assert farthest(exact[slow], perturbed) < 1e-7


def test_the_step_maps_give_the_same_modes(prepared):
    """But for the FMUs' integrators, which are of order four."""
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        perturbed = eigenvalues(compose(Blocks(master), master.schedule))
        exact = eigenvalues(compose(Blocks(master, directional=True), master.schedule))
    slow = np.abs(exact) < 2 * np.pi * 5
    assert farthest(exact[slow], perturbed) < 1e-5


def test_the_named_mode_is_the_same(prepared):
    by_perturbation = compute_modes(prepared).electromechanical
    by_derivatives = compute_modes(prepared, directional=True).electromechanical
    assert by_derivatives.eigenvalue == pytest.approx(by_perturbation.eigenvalue, abs=1e-6)


def test_a_kind_without_derivatives_is_refused_with_the_remedy():
    prepared = prepare_one("two_area", "base", {"*.native": True, "sg2.native": False})
    with (
        Master(prepared.system, prepared.schedule, prepared.step_size) as master,
        pytest.raises(
            AnalysisError, match=r"component 'sg2'.*no directional derivatives.*--native"
        ),
    ):
        Blocks(master, directional=True)


# -- derivatives that are wrong --------------------------------------------------------------------


def lag_with_wrong_derivatives(folder, monkeypatch, state=1.0, entry=1.0, *, settable=True):
    """A native lag whose directional derivatives along its state and its input are scaled; all else is right."""
    model = small_fmus.lag()
    right = native_fmu.derivative_functions

    def wrong(of):
        functions = right(of)
        known = functions["direction"].inputs
        scaled = list(known)
        # directions of x and u
        scaled[4], scaled[5] = [state * d for d in known[4]], [entry * d for d in known[5]]
        return functions | {
            "direction": Function("direction", known, functions["direction"].of(*scaled))
        }

    monkeypatch.setattr(native_fmu, "derivative_functions", wrong)
    path = export(NativeFmu(model), folder / "made", (host_platform(),))
    if not settable:
        closed = folder / "closed.fmu"
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(closed, "w") as new:
            for name in old.namelist():
                new.writestr(
                    name,
                    old.read(name).replace(b'settable="true"', b'settable="false"')
                    if name == "modelDescription.xml"
                    else old.read(name),
                )
        path = closed
    system = System()
    system.add("lag", read_description(path), {"T": 0.5})
    system.add("source", small_fmus.small_fmu("integrator"), {"gain": -1.0})
    system.connect("lag.y", "source.u")
    system.connect("source.y", "lag.u")
    return Master(system, gauss_seidel((("lag",), ("source",))), 1e-3)


def by_derivatives(master):
    return linearize_by_derivatives(master.exchanges["lag"], master.time, 1e-3)


@pytest.mark.parametrize(
    ("state", "entry", "of", "n"), [(-1.0, 1.0, "x", 2), (1.001, 1.0, "x", 2), (1.0, 1.01, "u", 1)]
)
def test_wrong_derivatives_are_refused_with_their_name(tmp_path, monkeypatch, state, entry, of, n):
    with (
        lag_with_wrong_derivatives(tmp_path, monkeypatch, state, entry) as master,
        pytest.raises(
            AnalysisError,
            match=rf"component 'lag'.*wrong in {n} of 4.*(der\(x\)|y) by {of} is given as",
        ),
    ):
        by_derivatives(master)


@pytest.mark.parametrize("state", [1.0, -1.0])
def test_where_states_cannot_be_set_the_response_tells(tmp_path, monkeypatch, state):
    with lag_with_wrong_derivatives(tmp_path, monkeypatch, state, settable=False) as master:
        if state == 1.0:
            found = by_derivatives(master)
            assert found.source == "directional"
            assert found.A[0, 0] == pytest.approx(np.exp(-1e-3 / 0.5), rel=1e-12)
        else:
            with pytest.raises(
                AnalysisError, match="directional derivatives is not what the FMU does"
            ):
                by_derivatives(master)


def test_directional_derivatives_are_said_to_be_the_source(prepared):
    result = compute_modes(prepared, directional=True)
    assert set(result.linearised.values()) == {"directional"}
