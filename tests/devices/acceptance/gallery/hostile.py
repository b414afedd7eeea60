"""Archives and model descriptions that are made to do harm."""

import stat
import zipfile

XML = "modelDescription.xml"


def _copy(good, folder, name, change=None, extra=()):
    """A copy of a good FMU with another description, and with further entries."""
    path = folder / f"{name}.fmu"
    with (
        zipfile.ZipFile(good) as source,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for entry in source.namelist():
            content = source.read(entry)
            target.writestr(entry, change(content) if change and entry == XML else content)
        for entry, content in extra:
            target.writestr(entry, content)
    return path


def traversal(folder, good):
    return _copy(good, folder, "path_traversal", extra=[("../../outside.txt", b"out")])


def absolute(folder, good):
    return _copy(good, folder, "absolute_path", extra=[("/outside.txt", b"out")])


def backslash(folder, good):
    return _copy(good, folder, "backslash_path", extra=[("..\\outside.txt", b"out")])


def link(folder, good):
    entry = zipfile.ZipInfo("resources/link")
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    return _copy(good, folder, "symbolic_link", extra=[(entry, b"/etc/passwd")])


def bomb(folder, good):
    return _copy(
        good, folder, "zip_bomb", extra=[(f"resources/{k}", bytes(50 * 1024**2)) for k in range(4)]
    )


def liar(folder, good):
    """A size in the directory that is far less than what comes out."""
    path = _copy(good, folder, "false_size", extra=[("resources/zeros", bytes(200 * 1024**2))])
    content = bytearray(path.read_bytes())
    true, false = (200 * 1024**2).to_bytes(4, "little"), (1000).to_bytes(4, "little")
    assert content.count(true) == 2
    path.write_bytes(content.replace(true, false))
    return path


def twice(folder, good):
    return _copy(
        good,
        folder,
        "same_file_twice",
        extra=[("resources/a.txt", b"1"), ("resources/A.TXT", b"2")],
    )


def other_bytes(folder, good):
    """One name twice, with different bytes: what is unpacked depends on who unpacks it."""
    return _copy(
        good, folder, "other_bytes_twice", extra=[("extra/a.txt", b"1"), ("extra/a.txt", b"2")]
    )


def same_bytes(folder, good):
    """One name twice with the same bytes, as CMake lists it; harmless."""
    return _copy(
        good, folder, "same_bytes_twice", extra=[("extra/a.txt", b"1"), ("extra/a.txt", b"1")]
    )


def entities(folder, good):
    laughs = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 10))
    head = f'<!DOCTYPE x [<!ENTITY l0 "lol">{laughs}]>'.encode()
    return _copy(
        good,
        folder,
        "entity_expansion",
        lambda text: text.replace(b"<fmiModel", head + b"<fmiModel", 1),
    )


def external(folder, good):
    head = b'<!DOCTYPE x [<!ENTITY file SYSTEM "file:///etc/passwd">]>'
    return _copy(
        good,
        folder,
        "external_entity",
        lambda text: text.replace(b"<fmiModel", head + b"<fmiModel", 1),
    )


def deep(folder, good):
    nest = b"<Tool name='x'>" + b"<a>" * 200_000 + b"</a>" * 200_000 + b"</Tool>"
    place = b"<ModelVariables>"
    annotations = b"<VendorAnnotations>" + nest + b"</VendorAnnotations>"
    return _copy(
        good, folder, "deep_nesting", lambda text: text.replace(place, annotations + place, 1)
    )


HOSTILE = {
    "path_traversal": (traversal, "path traversal"),
    "absolute_path": (absolute, "path traversal"),
    "backslash_path": (backslash, "path traversal"),
    "symbolic_link": (link, "path traversal"),
    "zip_bomb": (bomb, "zip bomb"),
    "same_file_twice": (twice, "hostile archive"),
    "other_bytes_twice": (other_bytes, "hostile archive"),
    "entity_expansion": (entities, "entity expansion"),
    "external_entity": (external, "entity expansion"),
    "deep_nesting": (deep, "hostile archive"),
}
"""What makes each from a good FMU, and the name of its fault; a file that lies about its sizes is damaged."""
