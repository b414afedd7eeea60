"""Mutated FMUs, read and unpacked one after another in a process that may write in one folder only.

Run as ``python -m tests.devices.fmi.fuzz SEED COUNT FOLDER FMU…``; it prints how many were accepted and refused, and
ends with the first one for which anything else happened.
"""

import io
import json
import os
import random
import re
import shutil
import stat
import sys
import zipfile
from pathlib import Path

from orchestrator.core.errors import FmuFileError
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.sandbox.access_restriction import landlock_version, restrict
from orchestrator.devices.sandbox.resource_limits import Limits, apply_limits

XML = "modelDescription.xml"
NAMES = (
    *(
        "../out",
        "../../../../out",
        "/out",
        "C:\\out",
        "..\\out",
        "a/../../out",
        "CON",
        "a\0b",
        "a//b",
        "x" * 300,
        "",
    ),
    *(
        "resources/" + "d/" * 600 + "f",
        "modeldescription.XML",
        "binaries",
        "a\nb",
        "\u202eout",
        "a:b",
        "-",
        "~",
        " ",
    ),
)
VALUES = (
    *(
        "",
        "-1",
        "4294967296",
        "99999999999999999999",
        "NaN",
        "inf",
        "1e999",
        "true",
        "2.0",
        "../../out",
        "\u202e",
    ),
    *("x" * 100_000, "&lt;", "{0}", "%s%n", "0x10", "1.0", "continuous", "Real", "output", "None"),
)
WORDS = (
    *("input", "output", "parameter", "Real", "Unknown", "ScalarVariable", "index"),
    *("CoSimulation", "ModelExchange", "modelIdentifier", "2.0", "Unit"),
)
MARKS = ("<", ">", "&", '"', "\0", "]]>", "<!--", "&#0;", "&x;", "\ud7ff")
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
DOCTYPES = (
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>',
    '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE x [<!ENTITY % p SYSTEM "http://localhost/x"> %p;]>',
)


def mutated(chance: random.Random, good: bytes) -> bytes:
    """One mutation of an archive: of its bytes, its entries, or its model description."""
    kind = chance.choice(
        (
            bytes_changed,
            bytes_changed,
            cut,
            entries_changed,
            entries_changed,
            *[description_changed] * 5,
        )
    )
    return kind(chance, good)


def bytes_changed(chance, good):
    content = bytearray(good)
    # Most of what matters stands at the two ends.
    ends = [range(200), range(len(content) - 600, len(content)), range(len(content))]
    for _ in range(chance.choice((1, 1, 2, 5, 50))):
        content[chance.choice(chance.choice(ends))] = chance.randrange(256)
    return bytes(content)


def cut(chance, good):
    place = chance.randrange(len(good))
    head, tail = good[:place], good[place:]
    gap, noise = tail[chance.randrange(500) :], chance.randbytes(100)
    return chance.choice((head, tail, head + gap, good + good, noise + good, head + noise + tail))


def entries_changed(chance, good):
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(good)) as source,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for entry in source.namelist():
            if chance.random() < 0.9:
                target.writestr(entry, source.read(entry))
        for _ in range(chance.randrange(4)):
            info = zipfile.ZipInfo("x")
            info.filename = info.orig_filename = chance.choice((*NAMES, XML, *source.namelist()))
            if chance.random() < 0.3:
                kind = chance.choice((stat.S_IFLNK, stat.S_IFCHR, stat.S_IFIFO, stat.S_IFDIR))
                info.external_attr = kind << 16
            info.compress_type = chance.choice(METHODS)
            size = chance.choice((0, 10, 10, 1000, 20_000_000 if chance.random() < 0.1 else 5))
            try:
                target.writestr(info, bytes(size))
            except (ValueError, UnicodeError, KeyError, zipfile.LargeZipFile):
                continue  # zipfile itself will not write it
    content = bytearray(buffer.getvalue())
    if chance.random() < 0.3:  # flags, methods and sizes in the directory
        for match in list(re.finditer(rb"PK\x01\x02", content))[-3:]:
            content[match.start() + chance.choice((6, 8, 10, 16, 20, 24, 28, 42))] ^= (
                1 << chance.randrange(8)
            )
    return bytes(content)


def description_changed(chance, good):
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(good)) as source,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for entry in source.namelist():
            content = source.read(entry)
            target.writestr(entry, text_changed(chance, content) if entry == XML else content)
    return buffer.getvalue()


def text_changed(chance, content):
    text = content.decode()
    for _ in range(chance.choice((1, 1, 1, 2, 4, 20))):
        text = chance.choice(EDITS)(chance, text)
    return text.encode("utf-8", "surrogatepass")


def _somewhere(chance, text, pattern, group=0):
    """One of the places where a pattern fits: before it, itself, after it."""
    found = list(re.finditer(pattern, text))
    if not found:
        return text, "", ""
    match = chance.choice(found)
    return text[: match.start(group)], match.group(group), text[match.end(group) :]


def other_value(chance, text):
    before, _, after = _somewhere(chance, text, r'="([^"]*)"', 1)
    return before + chance.choice(VALUES) + after


def other_attribute(chance, text):
    before, old, after = _somewhere(chance, text, r' \w+="[^"]*"')
    return before + chance.choice(("", ' x="1"', old * 2)) + after


def other_count(chance, text):
    before, old, after = _somewhere(chance, text, r"<\w+[^<>]*/>")
    return before + old * chance.choice((0, 2, 200)) + after


def a_mark(chance, text):
    place = chance.randrange(len(text) + 1)
    return text[:place] + chance.choice(MARKS) + text[place:]


def a_gap(chance, text):
    place = chance.randrange(len(text) + 1)
    return text[:place] + text[place + chance.randrange(300) :]


def a_document_type(chance, text):
    return text.replace("<fmiModel", chance.choice(DOCTYPES) + "<fmiModel", 1)


def another_encoding(chance, text):
    name = chance.choice(("UTF-16", "latin-1", "none", "UTF-7"))
    return re.sub(r'encoding="[^"]*"', f'encoding="{name}"', text, count=1)


def a_deep_nest(chance, text):
    return text.replace(
        "<ModelVariables>", "<a>" * chance.choice((10, 1000, 100_000)) + "<ModelVariables>", 1
    )


def another_word(chance, text):
    old, new = chance.sample(WORDS, 2)
    return text.replace(old, new, chance.choice((1, 1000)))


EDITS = (
    other_value,
    other_attribute,
    other_count,
    a_mark,
    a_gap,
    a_document_type,
    another_encoding,
    a_deep_nest,
    another_word,
)


def outcome(path: Path, folder: Path) -> str:
    """Read and unpack one file, as everything that opens an FMU does."""
    try:
        description = read_description(path)
        extract(path, folder)
    except FmuFileError as error:
        text = str(error)
        if not text.startswith(f"{path}: ") or len(text) > 2000 or "Traceback" in text:
            raise AssertionError(f"not one clear error: {text[:500]}") from error
        if folder.exists():
            raise AssertionError("what was refused left files behind") from error
        return "refused"
    draft_binding(description)
    for file in folder.rglob("*"):
        if file.is_symlink() or not file.resolve().is_relative_to(folder.resolve()):
            raise AssertionError(f"{file} is not inside of the folder")
    return "accepted"


def main(seed: int, count: int, folder: Path, sources: list[Path]) -> dict[str, int]:
    contents = [source.read_bytes() for source in sources]
    inner = folder / "a" / "b" / "c"
    inner.mkdir(parents=True)
    around = sorted(folder.rglob("*"))
    apply_limits(Limits(memory=1 << 30, output=128 << 20), folder, own_users=False)
    if landlock_version():
        restrict([Path("/")], [folder, Path(os.devnull)])
    found = {"accepted": 0, "refused": 0}
    for number in range(seed, seed + count):
        chance = random.Random(number)
        path = inner / "mutated.fmu"
        path.write_bytes(mutated(chance, chance.choice(contents)))
        try:
            found[outcome(path, inner / "out")] += 1
        except Exception as error:
            raise AssertionError(f"mutation {number}: {error!r}") from error
        shutil.rmtree(inner / "out", ignore_errors=True)
        path.unlink()
        left = [p for p in sorted(folder.rglob("*")) if p not in around]
        assert not left, f"mutation {number} left {left[:3]}"
    return found


if __name__ == "__main__":
    print(
        json.dumps(
            main(
                int(sys.argv[1]),
                int(sys.argv[2]),
                Path(sys.argv[3]),
                [Path(p) for p in sys.argv[4:]],
            )
        )
    )
