"""Certificates that earlier versions issued still hold, and a change of theirs is still seen.

Each archive has what `gfor verify --files-only` reads: one of 0.2.0 and one with a POD of the damping test, each of one
line reactance, and one of Fingrid's table on powers that were made up, which archives well.
"""

import json
import math
import shutil
from pathlib import Path

import pytest
import xarray as xr

from orchestrator.core.file_hashes import sha256_of
from orchestrator.studies.certification.files import figures_hash, write_sealed
from orchestrator.studies.certification.kinds import rebuilt

ISSUED = Path(__file__).parent / "issued"
VERDICTS = {"nts631_of_0_2": "incomplete", "nts631_pod_p": "incomplete", "fingrid": "incomplete"}


@pytest.fixture
def issued(tmp_path):
    def unpacked(name):
        shutil.unpack_archive(ISSUED / f"{name}.zip", tmp_path / name)
        return tmp_path / name

    return unpacked


def verified(gfor, folder):
    code, text, error = gfor("verify", folder, "--json", "--files-only")
    assert code in (3, 5), error
    return code, json.loads(text)["faults"]


@pytest.mark.parametrize("name", VERDICTS)
def test_what_was_issued_holds(issued, gfor, name):
    assert verified(gfor, issued(name)) == (3, [])


def test_a_point_of_unknown_stability_failed_and_still_does(issued):
    """Until 0.3 such a point was not accepted; now it is not judged."""
    folder = issued("nts631_of_0_2")
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    (point,) = content["points"]
    point["stability"]["with"] = {"stable": None, "sentence": "not known: it answers otherwise"}
    with xr.open_dataset(folder / "responses.nc", engine="scipy") as data:
        assert rebuilt(folder, content, data).verdicts[0].unknown
        point["faults"] = ["nothing shows that the system is stable"]
        assert rebuilt(folder, content, data).verdict == "fails"


def forged(folder, content):
    """Make the page and all hashes fit, as whoever knows this program can."""
    old = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    page = folder / "certificate.html"
    page.write_text(
        page.read_text(encoding="utf-8").replace(figures_hash(old), figures_hash(content)), "utf-8"
    )
    content["files"] = {name: sha256_of(folder / name) for name in content["files"]}
    del content["seal"]
    write_sealed(content, folder / "certificate.json")


def test_a_point_that_was_taken_out_with_its_word_is_missed(issued, gfor):
    """Beyond the norm's own reactances nothing counts how many there are, but the responses do."""
    folder = issued("nts631_of_0_2")
    data = xr.load_dataset(folder / "responses.nc", engine="scipy")
    data.isel(X_L=[0, 0]).assign_coords(X_L=[0.3, 0.7]).to_netcdf(
        folder / "responses.nc", engine="scipy"
    )
    forged(folder, json.loads((folder / "certificate.json").read_text(encoding="utf-8")))
    code, faults = verified(gfor, folder)
    assert (code, faults) == (5, ["the record has no points for the responses at X_L = 0.7 pu"])


def a_damping(content):
    content["points"][0]["modes"][0]["damping_percent"] *= 1.5


def an_eigenvalue(content):
    content["points"][0]["modes"][0]["real"] *= 1.5


def a_mode_less(content):
    del content["points"][0]["time"]["modal"]["modes"][0]


def a_swing(content):
    content["points"][0]["time_without"]["swings"]["swings"][0]["depth"] *= 1.01


def a_margin(content):
    content["rows"][2]["criteria"][1]["margin"] += 0.01


def a_text(content):
    content["rows"][2]["criteria"][1]["text"] = "0.987 pu"


def a_column(content):
    (content.get("points") or content["rows"])[0]["remark"] = "approved"


def an_excuse(content):
    damping = 100 * 0.01 / abs(complex(-0.01, 4.0))
    value = {"real": -0.01, "imag": 4.0, "frequency_hz": 2 / math.pi, "damping_percent": damping}
    content["points"][0]["modes"][0]["without"] = value


def a_column_of_a_known_name(content):
    (content.get("points") or content["rows"])[0]["details"] = "approved"


def a_value(content):
    content["values"]["current_limit.kind"] = 0


def another_code(content):
    content["code"] = "nogrr245"


def files_of_a_row(content):
    content["rows"][0]["files"] = "approved"


def a_verdict(content):
    content["verdict"] = "passes"


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("nts631_of_0_2", a_damping, "damping_percent"),
        ("nts631_of_0_2", an_eigenvalue, "damping_percent"),
        ("nts631_pod_p", a_swing, "depth"),
        ("nts631_pod_p", a_mode_less, "modal.modes"),
        ("nts631_pod_p", a_column, "remark"),
        ("nts631_of_0_2", an_excuse, "a mode without the converter is none"),
        ("fingrid", a_column_of_a_known_name, "details"),
        ("fingrid", files_of_a_row, "files"),
        ("nts631_of_0_2", a_verdict, "verdict"),
        ("fingrid", a_value, "not what the table of fingrid and the certified values give"),
        ("fingrid", another_code, "the table of nogrr245 has none of the rows"),
        ("fingrid", a_margin, "margin"),
        ("fingrid", a_text, "0.987 pu"),
        ("fingrid", a_column, "remark"),
        ("fingrid", a_verdict, "verdict"),
    ],
)
def test_a_change_is_seen_though_every_hash_fits(issued, gfor, name, change, said):
    folder = issued(name)
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    change(content)
    forged(folder, content)
    code, faults = verified(gfor, folder)
    assert code == 5
    assert any(said in text for text in faults), faults


@pytest.mark.parametrize(("name", "signal"), [("nts631_of_0_2", "sg1.p"), ("fingrid", "jumps.p")])
def test_another_response_comes_to_another_verdict(issued, gfor, name, signal):
    folder = issued(name)
    data = xr.load_dataset(folder / "responses.nc", engine="scipy")
    data[signal].values[...] = 2 * data[signal].values - 0.9 * data[signal].values[..., :1]
    data[signal].values[..., -3000:] *= 1.3
    data.to_netcdf(folder / "responses.nc", engine="scipy")
    forged(folder, json.loads((folder / "certificate.json").read_text(encoding="utf-8")))
    code, faults = verified(gfor, folder)
    assert (code, len(faults) > 2) == (5, True), faults
