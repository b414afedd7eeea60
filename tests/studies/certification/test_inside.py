"""Certificates inside their FMU: verified, joined, forged, and repeated by FMPy alone."""

import json
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace

import pytest

import orchestrator as gfor
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.fingrid import FINGRID
from orchestrator.studies.certification.files import spare_another
from orchestrator.studies.certification.inside import FOLDER, taken_out
from tests.pages.markdown import ROOT, blocks
from tests.support.grid_codes import replace_code

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def one_row():
    """Two tables with their jumps alone."""
    with pytest.MonkeyPatch.context() as patch:
        for code in (ERCOT, FINGRID):
            jumps = [row for row in code.rows if row.name.endswith("jumps")]
            replace_code(patch, replace(code, rows=tuple(jumps[:1])))
        yield


@pytest.fixture(scope="module")
def converter(tmp_path_factory):
    return gfor.build("gfor", tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module")
def certified(converter, tmp_path_factory):
    folder = tmp_path_factory.mktemp("certified")
    gfor.certify(
        converter, "ercot", check=False, folder=folder / "ercot", into=folder / "certified.fmu"
    )
    return folder / "certified.fmu"


@pytest.fixture(name="gfor_command")
def _gfor_command(request):
    """The command of the same name as the module that is imported here."""
    return request.getfixturevalue("gfor")


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """The page's program."""
    (block,) = (
        b for b in blocks(ROOT / ".docs" / "how-to" / "certify.md") if b.path == "repeat.py"
    )
    path = tmp_path_factory.mktemp("page") / "repeat.py"
    path.write_text(block.text, encoding="utf-8")
    return path


def repeated(script, fmu):
    done = subprocess.run(
        [sys.executable, str(script), str(fmu)], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_it_verifies_and_the_tested_fmu_comes_out_byte_for_byte(certified, converter, tmp_path):
    assert gfor.verify(certified, every=True).holds
    (place,) = taken_out(certified, tmp_path)
    assert (place / "converter.fmu").read_bytes() == converter.read_bytes()
    assert gfor.verify(place, anew=()).holds


def test_fmpy_alone_repeats_it_and_sees_another_fmu(certified, script, tmp_path):
    (said,) = repeated(script, certified)
    assert "the same within" in said
    other = tmp_path / "certified.fmu"
    with zipfile.ZipFile(certified) as old, zipfile.ZipFile(other, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name.endswith("parameters.ssv"):
                data = re.sub(rb'(name="droop.R_f">\s*<[^>]* value=")[^"]*', rb"\g<1>0.1", data)
            new.writestr(name, data)
    assert "ANOTHER ANSWER" in repeated(script, other)[0]


def test_a_certificate_by_another_code_is_not_replaced(converter, tmp_path, gfor_command):
    (tmp_path / "certificate.json").write_text('{"code": "miso"}')
    code, _, said = gfor_command(
        "certify", converter, "--code", "ercot", "--no-check", "--out", tmp_path
    )
    assert code == 2
    assert "it holds a certificate by miso, which one by ercot would replace" in " ".join(
        said.split()
    )
    spare_another(tmp_path, "miso", converter, None)


@pytest.mark.parametrize("name", ["certificate.json", "certificate.html", "responses.nc"])
def test_what_is_no_certificate_is_not_replaced(converter, tmp_path, name):
    (tmp_path / name).write_text('{"mine": 1}')
    (tmp_path / "manifest.json").write_text("mine")
    with pytest.raises(gfor.CosimError, match=f"{name}: this file would be written over"):
        spare_another(tmp_path, "nts631", converter, None)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    (tmp_path / "points").mkdir()
    (tmp_path / "points" / "mine.csv").touch()
    with pytest.raises(gfor.CosimError, match=f"{name}: this file would be written over"):
        spare_another(tmp_path, "nts631", converter, None)


@pytest.mark.parametrize(
    ("name", "code"),
    [("converter.fmu", "ercot"), ("case.toml", "nts631"), ("row_dip.toml", "ercot")],
)
def test_files_of_others_in_the_folder_are_not_replaced(
    converter, tmp_path, gfor_command, name, code
):
    out = tmp_path / "own"
    out.mkdir()
    (out / name).write_text("mine")
    found, _, said = gfor_command("certify", converter, "--code", code, "--no-check", "--out", out)
    assert found == 2
    assert (
        f"{out / name}: this file would be written over, and no command has written it"
        in " ".join(said.split())
    )
    with pytest.raises(gfor.CosimError, match="no command has written it"):
        gfor.certify(converter, code, folder=out, check=False)
    assert (out / name).read_text() == "mine"
    other = "ercot" if code == "nts631" else "nts631"
    (out / name).write_bytes(converter.read_bytes())
    # the same FMU; a case that this code writes none over
    spare_another(out, other, converter, None)
    (out / "case.toml").write_text("# Damping test of gfor.fmu, written by `gfor certify`.")
    spare_another(out, "nts631", converter, None)  # it was killed before its first point


def test_a_second_code_joins_and_the_same_code_replaces_its_own(
    certified, converter, tmp_path, gfor_command
):
    both = tmp_path / "both.fmu"
    shutil.copy(certified, both)
    for _ in range(2):
        code, _, _ = gfor_command(
            "certify",
            converter,
            "--code",
            "fingrid",
            "--no-check",
            "--out",
            tmp_path / "out",
            "--into",
            both,
        )
        assert code in (0, 1, 3)
    with zipfile.ZipFile(both) as archive:
        names = archive.namelist()
    assert len(names) == len(set(names))
    assert {name.split("/")[2] for name in names if name.startswith(FOLDER)} == {
        "ercot",
        "fingrid",
        "tested.json",
    }
    code, said, _ = gfor_command("verify", both, "--files-only", "--json")
    assert [one["code"] for one in json.loads(said)["certificates"] if one["holds"]] == [
        "ercot",
        "fingrid",
    ]


@pytest.mark.parametrize(
    "member", ["responses.nc", "row_phase_jumps.toml", "certificate.json", "certificate.html"]
)
def test_a_changed_member_of_the_certificate_does_not_hold(
    certified, member, tmp_path, gfor_command
):
    forged, name = tmp_path / "forged.fmu", f"{FOLDER}/ercot/{member}"
    shutil.copy(certified, forged)
    with zipfile.ZipFile(forged) as archive:
        data = archive.read(name)
    with zipfile.ZipFile(forged, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr(name, data.replace(b"0.", b"1.", 1))
    code, _, said = gfor_command("verify", forged, "--files-only")
    assert code in (2, 5), said


def test_a_changed_byte_of_the_fmu_does_not_hold(certified, tmp_path, gfor_command):
    content, forged = bytearray(certified.read_bytes()), tmp_path / "forged.fmu"
    with zipfile.ZipFile(certified) as archive:
        # its time, which nothing reads
        content[archive.getinfo("modelDescription.xml").header_offset + 10] ^= 1
    forged.write_bytes(content)
    code, said, _ = gfor_command("verify", forged, "--files-only", "--json")
    assert code == 5
    assert any(
        "it is not the file that was certified" in text
        for text in json.loads(said)["certificates"][0]["faults"]
    )


def test_a_file_of_a_stranger_is_refused_in_words(certified, tmp_path, gfor_command):
    """No certificate is left in it, its archive is damaged, a member leads out of its folder."""
    emptied, cut, hostile = (tmp_path / f"{name}.fmu" for name in ("emptied", "cut", "hostile"))
    with zipfile.ZipFile(certified) as old, zipfile.ZipFile(emptied, "w") as new:
        for name in old.namelist():
            if not name.startswith(f"{FOLDER}/ercot/"):
                new.writestr(name, old.read(name))
    content = bytearray(certified.read_bytes())
    with zipfile.ZipFile(certified) as archive:
        begin = archive.getinfo(f"{FOLDER}/ercot/responses.nc").header_offset
    content[begin + 200 : begin + 400] = bytes(200)
    cut.write_bytes(content)
    shutil.copy(certified, hostile)
    with zipfile.ZipFile(hostile, "a") as archive:
        archive.writestr(f"{FOLDER}/ercot/../../../../out.json", "{}")
    for fmu, words in (
        (emptied, "there is no certificate in it"),
        (cut, "damaged"),
        (hostile, "a path out of"),
    ):
        code, _, said = gfor_command("verify", fmu, "--files-only")
        assert code == 2
        assert words in " ".join(said.split()), said
    with pytest.raises(gfor.CosimError, match="no certificate in it"):
        gfor.verify(emptied, anew=())


def test_what_cannot_take_a_certificate_is_refused_before_anything_is_computed(
    certified, converter, tmp_path, gfor_command
):
    other = gfor.build("infinite_bus", tmp_path)
    referenced = gfor.build("gfor", tmp_path / "referenced", reference=True)
    library = tmp_path / "text.fmu"
    library.write_text("no archive", encoding="utf-8")
    for fmu, into, words in (
        (converter, other, "is not the FMU that was tested"),
        (certified, tmp_path / "new.fmu", "certify the FMU without certificates"),
        (referenced, tmp_path / "new.fmu", "manifest of LS-REF already"),
        (converter, library, "exists and is no FMU"),
    ):
        code, _, said = gfor_command(
            "certify", fmu, "--code", "ercot", "--no-check", "--into", into, "--out", tmp_path
        )
        assert code == 2
        assert words in " ".join(said.split()), said
    code, _, said = gfor_command("verify", other)
    assert code == 2
    assert "there is no certificate in it" in " ".join(said.split())
