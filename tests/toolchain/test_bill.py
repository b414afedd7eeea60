"""The bill in an FMU names every file of it, by the hash that the file has."""

import hashlib
import json
import zipfile

import pytest

import orchestrator as gfor
from fmus.toolchain.bill import BILL


@pytest.mark.parametrize("native", [False, True])
def test_the_bill_has_every_file_and_whose_code_it_is(tmp_path, native):
    fmu = gfor.build("infinite_bus", tmp_path / "one", native=native)
    with zipfile.ZipFile(fmu) as archive:
        bill = json.loads(archive.read(BILL))
        members = {name: archive.read(name) for name in archive.namelist() if name != BILL}
    stated = {
        part["name"]: part["hashes"][0]["content"]
        for part in bill["components"]
        if part["type"] == "file"
    }
    assert stated == {name: hashlib.sha256(data).hexdigest() for name, data in members.items()}
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    libraries = {part["name"]: part for part in bill["components"] if part["type"] == "library"}
    assert ("pythonfmu" in libraries) == (not native)
    assert all(part["licenses"] and part["version"] for part in libraries.values())
    again = gfor.build("infinite_bus", tmp_path / "two", native=native)
    assert again.read_bytes() == fmu.read_bytes()
