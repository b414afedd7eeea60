"""A foreign FMU whose linear model is not the whole truth: growth that it does not declare, and sampled control."""

import shutil
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.description import read_description
from orchestrator.linear.doubts import coupled_response
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.spectra.stability import judge
from orchestrator.studies.black_box.bench import Bench
from orchestrator.studies.black_box.frequency_response import Excitation, measure
from orchestrator.studies.modes.linear import linear_model
from orchestrator.studies.modes.modes import compute_modes, running
from tests.devices.acceptance.gallery.build import Source, Variable, build
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

pytestmark = pytest.mark.usefixtures("in_process")

STATES = {"x": 2, "v": 3}


def declared(text):
    """The description with the states, their derivatives, and that they can be set."""
    root = ElementTree.fromstring(text)
    variables = root.find("ModelVariables")
    index = {v.get("name"): k for k, v in enumerate(variables, start=1)}
    derivatives = ElementTree.Element("Derivatives")
    for name in STATES:
        rate = f"der({name})"
        variables[index[rate] - 1].find("Real").set("derivative", str(index[name]))
        ElementTree.SubElement(derivatives, "Unknown", index=str(index[rate]))
    for v in variables:
        if v.get("causality") == "local":
            v.set("initial", "calculated")
    root.find("ModelStructure").insert(1, derivatives)
    vendor = ElementTree.Element("VendorAnnotations")
    tool = ElementTree.SubElement(vendor, "Tool", name="gfor-cosim")
    ElementTree.SubElement(tool, "ContinuousStates", settable="true")
    root.insert(list(root).index(variables), vendor)
    return ElementTree.tostring(root)


def device(folder, name, **defines):
    local = {"causality": "local", "unit": "1"}
    variables = [
        Variable("u", 0, "input", 0.0, "1"),
        Variable("y", 1, "output", unit="1", depends=("x", "v")),
        *(Variable(state, number, **local) for state, number in STATES.items()),
        *(Variable(f"der({state})", number + 2, **local) for state, number in STATES.items()),
    ]
    code = str(Path(__file__).with_name("foreign_device.c"))
    return build(Source(name, code, defines, variables, change=declared), folder)


def loop(folder, fmu, K):
    """A device with the feedback u = K·y."""
    path = folder / "loop.toml"
    path.write_text(
        f"""
name = "loop"
title = "Loop"
source = "none"
[solver]
step_size = "1 ms"
stop_time = "1 s"
groups = [["device"], ["gain"]]
record = ["device.y"]
[components.device]
fmu = '{fmu}'
[components.gain]
fmu = '{small_fmu("gain").path}'
parameters = {{ K = {K} }}
[[connections]]
from = "device.y"
to = "gain.u"
[[connections]]
from = "gain.y"
to = "device.u"
[scenarios.base]
title = "Base"
""",
        encoding="utf-8",
    )
    prepared = prepare_one(str(path))
    return prepared


def modes(folder, fmu, K=-0.5):
    return compute_modes(loop(folder, fmu, K))


def test_an_honest_foreign_fmu_stays_stable_without_a_remark(tmp_path):
    found = modes(tmp_path, device(tmp_path, "honest"))
    assert found.stability.stable is True
    assert found.stability.reason == ""
    assert not found.warnings


def test_growth_that_an_fmu_does_not_declare_leaves_the_verdict_not_known(tmp_path):
    found = modes(tmp_path, device(tmp_path, "hiding", HIDDEN=1))
    assert found.stability.stable is None
    assert "component 'device' does not answer as its linear model does" in found.stability.reason
    assert any("not known" in warning for warning in found.warnings)
    assert found.stability.largest_growth_rate < 0  # what the declared states alone say


@pytest.mark.parametrize(
    "edge",
    [{"BAND": 3e-6}, {"BAND": 8e-6}, {"LIMIT": 5e-6}, {"LIMIT": 5e-6, "CURVED": 2e9}],
    ids=str,
)
def test_a_system_that_is_stable_within_an_edge_only_is_not_called_stable(tmp_path, edge):
    found = modes(tmp_path, device(tmp_path, "narrow", **edge))
    assert found.stability.largest_growth_rate < 0  # within the edge
    assert found.stability.stable is None
    assert (
        "after a disturbance of 1e-06 of each state, and not after one of 1e-05"
        in found.stability.reason
    )


def test_a_state_that_moves_by_curvature_alone_is_near_no_edge(tmp_path, monkeypatch):
    found = []
    compare = coupled_response.worst_disagreement
    monkeypatch.setattr(
        coupled_response,
        "worst_disagreement",
        lambda *given: found.append(compare(*given)) or found[-1],
    )
    stability = modes(tmp_path, device(tmp_path, "curved", CURVED=2e9)).stability
    assert (stability.stable, stability.reason) == (True, "")
    assert found[0].size == coupled_response.SIZES[-1]  # larger ones departed


@pytest.mark.parametrize("as_continuous", [False, True])
def test_a_linear_model_of_an_fmu_that_hides_growth_is_not_called_stable(tmp_path, as_continuous):
    prepared = loop(tmp_path, device(tmp_path, "hiding", HIDDEN=1), -0.5)
    _, _, examined = linear_model(prepared, [], ["device.y"], as_continuous=as_continuous)
    assert examined.stability.stable is None
    assert (
        "component 'device' does not answer as its linear model does" in examined.stability.reason
    )


def test_a_state_that_stands_still_though_its_derivative_does_not_is_named(tmp_path):
    found = modes(tmp_path, device(tmp_path, "sampled", SAMPLED=1))
    assert found.stability.stable is None
    assert (
        "'device' stands still over a communication step of 0.001 s (x)" in found.stability.reason
    )


def test_sampled_control_that_also_declares_no_derivative_is_seen_in_its_response(tmp_path):
    found = modes(tmp_path, device(tmp_path, "silent", SAMPLED=1, RATE_OF_NOTHING=1))
    assert found.stability.stable is None
    assert "does not answer as its linear model does" in found.stability.reason


def test_the_system_is_left_as_it_was(tmp_path):
    prepared = loop(tmp_path, device(tmp_path, "hiding", HIDDEN=1), -0.5)
    with running(prepared) as master:
        blocks = Blocks(master)
        model = compose(blocks, master.schedule)
        assert judge(model).stable
        before = {
            name: component.get([*component.description.variables])
            for name, component in everything(master)
        }
        y = master.y.copy()
        assert coupled_response.worst_disagreement(master, model).error > 0.05
        assert (master.y == y).all()
        assert master.index == 0
        assert {name: c.get([*c.description.variables]) for name, c in everything(master)} == before


def everything(master):
    return master.components.items()


def test_our_own_fmus_are_not_run_for_it(monkeypatch):
    def refuse(*arguments):
        raise AssertionError("an FMU of ours was run to confirm its own linear model")

    monkeypatch.setattr(coupled_response, "worst_disagreement", refuse)
    case = load_case("two_area")
    (prepared,) = case.prepare(["gfor"], {"*.native": True})
    assert compute_modes(prepared).stability.stable is True


def test_a_copy_of_our_converter_that_counts_as_foreign_agrees_to_a_hundredth(
    tmp_path, monkeypatch
):
    case = load_case("two_area")
    (prepared,) = case.prepare(["gfor"], {"*.native": True})
    plan = prepared.system.components["gfor"]
    copy = Path(shutil.copy(plan.description.path, tmp_path / "foreign.fmu"))
    with zipfile.ZipFile(copy, "a") as archive:
        archive.comment = b"another"
    prepared.system.components["gfor"] = replace(plan, description=read_description(copy))
    found = []
    compare = coupled_response.worst_disagreement

    def watched(*arguments):
        found.append(compare(*arguments))
        return found[-1]

    monkeypatch.setattr(coupled_response, "worst_disagreement", watched)
    result = compute_modes(prepared)
    assert result.stability.stable is True
    assert len(found) == 1
    assert 0 < found[0].error < 1e-2


@pytest.mark.parametrize("method", ["multisine", "pulse"])
def test_a_device_that_runs_away_while_it_is_measured_is_not_identified(tmp_path, method):
    """At its limit it answers as calmly as a stable device: v follows the input, x stays at 200."""
    excitation = Excitation(method, lowest_hz=0.5, highest_hz=100.0, lines=20)
    honest, runaway = (
        Bench(
            read_description(device(tmp_path, name, **defines)),
            {},
            np.zeros(1),
            ("u",),
            ("y",),
            step_size=1e-3,
        )
        for name, defines in (("honest", {}), ("runaway", {"RUNAWAY": 1}))
    )
    assert np.abs(measure(honest, excitation).operating_point).max() == 0
    with pytest.raises(AnalysisError, match="left the operating point by 200 pu and stayed away"):
        measure(runaway, excitation)
