"""Pack an sdist anew, so that the same files give the same bytes, or write a wheel's bill in the form of CycloneDX.

No time, owner or order of this machine is left in the sdist."""

import gzip
import hashlib
import io
import json
import sys
import tarfile
import zipfile
from email.parser import Parser
from pathlib import Path

TIME = 1577836800  # 2020-01-01, as of the members of our FMUs [s]


def repack(path: Path) -> None:
    with tarfile.open(path) as old:
        members = sorted(
            ((m, old.extractfile(m).read()) for m in old.getmembers() if m.isfile()),
            key=lambda member: member[0].name,
        )
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as new:
        for member, content in members:
            entry = tarfile.TarInfo(member.name)
            entry.size, entry.mtime = len(content), TIME
            entry.mode = 0o755 if member.mode & 0o100 else 0o644
            new.addfile(entry, io.BytesIO(content))
    path.write_bytes(gzip.compress(buffer.getvalue(), mtime=TIME))


def write_bill(wheel: Path) -> None:
    """Write what the wheel holds and what it needs beside it: FILE.cdx.json."""
    with zipfile.ZipFile(wheel) as archive:
        (place,) = (n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        said = Parser().parsestr(archive.read(place).decode())
        files = [
            {
                "type": "file",
                "name": name,
                "hashes": [
                    {"alg": "SHA-256", "content": hashlib.sha256(archive.read(name)).hexdigest()}
                ],
            }
            for name in sorted(archive.namelist())
        ]
    needed = [
        {"type": "library", "name": text.split(";")[0].strip(), "scope": "required"}
        for text in said.get_all("Requires-Dist", [])
        if "extra ==" not in text
    ]
    whole = hashlib.sha256(wheel.read_bytes()).hexdigest()
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "library",
                "name": said["Name"],
                "version": said["Version"],
                "licenses": [{"license": {"id": said["License-Expression"]}}],
                "hashes": [{"alg": "SHA-256", "content": whole}],
            }
        },
        "components": [*files, *needed],
    }
    wheel.with_suffix(".cdx.json").write_text(json.dumps(bill, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    for given in map(Path, sys.argv[1:]):
        write_bill(given) if given.suffix == ".whl" else repack(given)
