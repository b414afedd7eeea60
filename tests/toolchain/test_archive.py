"""The archive of an FMU: all its members, and the same bytes whatever was packed before."""

import io
import zipfile

from fmus.toolchain import archive
from fmus.toolchain.archive import packed

BINARY = bytes(range(256)) * 400  # 102,400 bytes: of the size that is compressed once


def test_an_archive_holds_its_members_and_none_of_the_one_packed_before():
    packed({"small.txt": b"one", "binary.so": BINARY})
    content = packed({"other.txt": b"two", "binary.so": BINARY})
    with zipfile.ZipFile(io.BytesIO(content)) as members:
        assert members.testzip() is None
        found = {name: members.read(name) for name in members.namelist()}
    assert found == {"other.txt": b"two", "binary.so": BINARY}


def test_its_bytes_follow_from_its_members_alone():
    members = {"small.txt": b"one", "binary.so": BINARY}
    first = packed(members)
    packed({"small.txt": b"two", "binary.so": BINARY[::-1]})
    archive._packed_before.cache_clear()
    assert packed(members) == first


def test_a_binary_is_compressed_once_for_archives_that_share_it():
    archive._packed_before.cache_clear()
    for text in (b"one", b"two", b"three"):
        packed({"small.txt": text, "binary.so": BINARY})
    assert archive._packed_before.cache_info().misses == 1
