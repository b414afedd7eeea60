"""What a reader of the pages alone stumbled over."""

import json

import pytest

from fmus.toolchain.model_builder import ModelBuilder
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.face.api import models
from orchestrator.face.cli import main
from orchestrator.linear.models.state_access import obstacle
from orchestrator.studies.black_box.frequency_response import Excitation, measure
from tests.devices.acceptance.conftest import gallery
from tests.studies.black_box.boxes import bench_of

__all__ = ["gallery"]


def test_info_as_json_has_what_the_file_declares(gallery, capsys):
    path = gallery("open_lag")[0]
    assert main(["fmu", "info", str(path), "--json"]) == 0
    found, described = json.loads(capsys.readouterr().out), read_description(path)
    assert (found["model_name"], found["fmi_version"]) == ("open_lag", "2.0")
    assert found["continuous_states"] == list(described.states)
    assert found["states_are_settable"] is True
    (d,) = [v for v in found["variables"] if v["name"] == "d"]
    assert (d["causality"], d["start"], d["unit"]) == ("parameter", 0.5, "1")
    assert [v["name"] for v in found["variables"]] == list(described.variables)


@pytest.mark.parametrize("command", ["fmu info", "modes", "fmu check"])
def test_a_folder_is_called_a_folder(command, tmp_path, capsys):
    (tmp_path / "case.toml").write_text("", encoding="utf-8")
    assert main([*command.split(), str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "it is a folder" in said
    assert "no such file" not in said


def test_an_fmu_that_cannot_save_its_state_is_told_all_that_linearisation_needs(gallery):
    with open_component(
        "box", read_description(gallery("converter_without_state")[0]), isolated=False
    ) as component:
        said = obstacle(component)
    assert "canGetAndSetFMUstate" in said
    assert "continuous states that a master may set" in said


def test_a_model_that_breaks_a_rule_is_one_error_of_one_line(monkeypatch, tmp_path, capsys):
    def lag():
        m = ModelBuilder("infinite_bus", "A lag")
        m.parameter("K", 2.0, "pu", "Gain")
        return m.build()

    monkeypatch.setattr(models, "build_model", lambda name: lag())
    assert main(["fmu", "build", "infinite_bus", "--dest", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert (
        "error: model 'infinite_bus' cannot be built: variable 'K' is in pu and names no base"
        in said
    )
    assert "Traceback" not in said


def test_a_build_says_what_it_is_at(tmp_path, capsys):
    assert main(["fmu", "build", "infinite_bus", "--dest", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert "infinite_bus: building, Python-backed (1 of 1)" in printed.err
    assert printed.out.strip().endswith("infinite_bus.fmu")


def test_an_identification_says_what_it_is_doing():
    """Before anything is run, and before each of the four runs."""
    said = []
    measure(bench_of("gfor"), Excitation(lowest_hz=5.0, lines=10), said.append)
    assert "brought to rest" in said[0]
    assert [line.rpartition(", ")[2] for line in said[1:]] == [
        f"run {k} of 4" for k in (1, 2, 3, 4)
    ]
    assert sum("v_re" in line for line in said) == 2


def test_critical_modes_that_are_none_are_a_sentence(capsys):
    """An empty table leaves open if the search failed; the paper's mode has 10.63 %."""
    assert main(["modes", "two_area_rms", "--scenario", "gfor", "--critical", "8"]) == 0
    said = capsys.readouterr().out
    assert (
        "no mode from 0.1 to 2 Hz is below 8 %; the least damped has 10.63 %, at 0.5813 Hz" in said
    )
    assert "Most associated states" not in said
