"""`gfor verify` says of every planted change what no longer agrees, and holds what nobody touched."""

import json
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from orchestrator.certification import study as study_module
from orchestrator.certification import verification
from orchestrator.certification.files import write_sealed
from orchestrator.certification.point import POWER
from orchestrator.cli import main
from tests.certification.fabricated import rings
from tests.certification.test_recomputing import BOUND


@pytest.fixture(scope="module")
def original(tmp_path_factory, fmu_path):
    """A certificate of two fabricated points."""
    folder = tmp_path_factory.mktemp("certificate")
    binding = folder / "mine.toml"
    binding.write_text(BOUND, encoding="utf-8")
    arguments = ["--no-check", "--reactances", "0.1,0.3", "--workers", "1", "--pod", "q"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", rings)
        words = ["certify", str(fmu_path("gfor")), "--binding", str(binding), *arguments, "--out", str(folder / "out")]
        assert main(words) == 3
    return folder / "out"


@pytest.fixture
def certificate(original, tmp_path, monkeypatch):
    monkeypatch.setattr(verification, "compute_point", rings)
    return shutil.copytree(original, tmp_path / "certificate")


def edited(folder, change, *, sealed=False):
    """Change the JSON; whoever knows how gives it a new seal."""
    path = folder / "certificate.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    if sealed:
        del content["seal"]
        write_sealed(content, path)
    else:
        path.write_text(json.dumps(content), encoding="utf-8")


def replaced(folder, name, old, new):
    path = folder / name
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def another_fmu(folder):
    with zipfile.ZipFile(folder / "converter.fmu", "a") as archive:
        archive.writestr("resources/tables.csv", "1,2")


def a_sample(folder):
    data = xr.load_dataset(folder / "responses.nc", engine="scipy")
    data[POWER].loc[{"scenario": "with", "X_L": 0.3}][700] += 1e-9
    data.to_netcdf(folder / "responses.nc", engine="scipy")


def verified(gfor, folder, *arguments):
    code, text, error = gfor("verify", folder, "--json", "--workers", 1, *arguments)
    assert code in (0, 1), error
    return code, json.loads(text)


def test_what_nobody_touched_holds(certificate, gfor):
    for path in (certificate, certificate / "certificate.json"):
        code, found = verified(gfor, path, "--all")
        assert (code, found["faults"], found["computed"]) == (0, [], [0.1, 0.3])
        assert sum("the same to the last digit" in text for text in found["agreed"]) == 8
    code, text, _ = gfor("verify", certificate, "--points", "0.3", "--workers", 1)
    assert code == 0
    assert "X_L = 0.3 pu, with the converter: modes: the same to the last digit" in text
    assert "no proof of who made it" in text


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("converter.fmu", another_fmu),
        ("vendor.toml", lambda f: replaced(f, "vendor.toml", "0.03", "0.04")),
        ("case.toml", lambda f: replaced(f, "case.toml", "governor", "other")),
        ("responses.nc", a_sample),
        ("certificate.html", lambda f: replaced(f, "certificate.html", "12.34"[:1], "9")),
        ("vendor.toml", lambda f: (f / "vendor.toml").rename(f / "binding.toml")),
        ("responses.nc", lambda f: (f / "responses.nc").unlink()),
    ],
)
def test_a_file_that_is_another_is_named(certificate, gfor, name, change):
    change(certificate)
    code, found = verified(gfor, certificate)
    assert code == 1
    assert any(text.startswith(f"{name}: ") for text in found["faults"])
    assert found["computed"] == []


def set_verdict(content):
    content.update(verdict="passes", passed=True)


def set_sentence(content):
    content["sentence"] = content["sentence"].replace("incomplete", "passes")


def set_damping(content):
    content["points"][0]["modes"][0]["damping_percent"] += 1.0


def set_growth(content):
    content["points"][0]["growth"]["with"] = 3.0


def set_power(content):
    content["points"][0]["power"] = 0.0


def set_ratio(content):
    content["points"][0]["time"]["swings"]["ratio"] = 0.0123


def drop_departures(content):
    content["missing"], content["judged"] = [], "13 of 13"


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize("change", [set_verdict, set_sentence, set_damping, set_growth, set_power, set_ratio])
def test_an_edited_figure_or_word_does_not_agree(certificate, gfor, change, sealed):
    """Also where the JSON's own hash was computed again: the words follow from the figures."""
    edited(certificate, change, sealed=sealed)
    code, found = verified(gfor, certificate, "--files-only")
    assert code == 1
    assert any("its own hash differs" in text for text in found["faults"]) != sealed


def test_a_figure_without_words_is_held_by_the_hash(certificate, gfor):
    edited(certificate, drop_departures)
    assert verified(gfor, certificate, "--files-only")[0] == 1


@pytest.mark.parametrize(
    ("damping", "signal", "code", "said"),
    [
        (1e-9, 1e-9, 0, "the digits differ"),
        (1e-4, 0.0, 1, "comes out and"),
        (0.0, 1e-3, 1, "of its range"),
    ],
)
def test_points_that_come_out_otherwise(certificate, gfor, monkeypatch, damping, signal, code, said):
    """Rounding is said and allowed; more is a disagreement."""

    def compute(task):
        found = rings(task)
        modes = replace(found.modes, eigenvalues=found.modes.eigenvalues * (1 + damping))
        signals = {name: values + signal * np.ptp(values) for name, values in found.signals.items()}
        return replace(found, modes=modes, signals=signals)

    monkeypatch.setattr(verification, "compute_point", compute)
    got, found = verified(gfor, certificate)
    assert got == code
    assert any(said in text for text in (found["faults"] if code else found["agreed"]))
    assert len(found["computed"]) == 1


def test_what_cannot_be_verified_is_said(certificate, gfor, tmp_path):
    code, _, error = gfor("verify", certificate, "--points", "0.2")
    assert (code, "it has: 0.1, 0.3" in error) == (2, True)
    code, _, error = gfor("verify", tmp_path / "nowhere")
    assert (code, "cannot be read" in error) == (2, True)
    edited(certificate, lambda content: content.pop("format"))
    code, _, error = gfor("verify", certificate)
    assert (code, "no certificate of format 2" in error) == (2, True)
