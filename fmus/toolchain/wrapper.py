"""pythonfmu's binaries, which go into every Python-backed FMU, with faults of them mended.

- When a process ends, the Linux library releases its interpreter twice: once by the destructor of a static C++ object,
  and once in its function ``finalizePythonInterpreter``, which then changes a counter in freed memory. Now and then
  this aborts the process after complete results. The second release is left out.
- It undoes "%20" of the resources' URI alone, and crashes where no such folder is: "ü" or "(" in a path ended the
  process. ``c/resources_path.c`` goes before its fmi2Instantiate. The one for Windows is left as it is: it opens files
  by names in the code page of the system.
- Both say that the FMU ended its simulation by itself wherever a step fails, and some masters then go on to the results
  as if all were well; some repeat a discarded step for ever. A step that fails is an error."""

import base64
import struct
from pathlib import Path

import pythonfmu

from fmus.toolchain.extras import SetupError

_ENTRY = b"\xf3\x0f\x1e\xfa"  # x86-64: endbr64
_RETURN = b"\xc3"  # x86-64: ret
_X86_64 = 62  # e_machine of an ELF file: EM_X86_64
_DYNAMIC_SYMBOLS = 11  # sh_type of a section: SHT_DYNSYM
_TO_LOAD = 1  # p_type of a segment: PT_LOAD
_EXECUTABLE = 1  # flag of a segment: PF_X
_ESCAPED_BLANK = b"\0%20\0"
_NEVER = b"\0\1\1\1\0"
_ENDS, _FAILS = bytes.fromhex("c6430801 b802000000"), bytes.fromhex("c6430800 b803000000")
"""Both compilers' machine code for: it wants to terminate; return fmi2Discard. And: it does not; return fmi2Error."""

_RESOURCES_PATH = base64.b85decode(
    "K~zbJ`bdoh#Q^{SRY-}|Q;G9Pf$RVf002mZ$#erqiO4b1NR2g~0RRAs3>JjRbPzy_JP=6#!az9BbnP+!>pC&gNR2gw0RRAs3>JjR4}?tt002OW"
    "d=Ldl|H42x&vfWWgTMvr4uJYEbO}iRz={xr(slB`0RR91G1BW7NP+tA4*&pkdWHXW6hMeH6iENTNdLk>iZDQg_I2UwVnBfYC3WTxzDNN?jakq^"
    "fcpt|21Jcn(CZX~$sk0HS)W0G`vrH!gXvd955CzCzDNQ@jbYG1fcyz}1%v4@>l1^?AViH}pFx291$Ul<=~oZF$w9&61W1Fx0zr*53+swVW5P&{"
    "4XXeE07!|#K#Dm)g#UC5K!`j9NdLh||G?|)NSMY11OPyU_H+kLg}`+|>uE@d=eQLB006!O0000F1xSU!b>+qc6aYw#6~q7l07!}XiQZ65iPuPD"
    "0!RVSi<BfN5C8yDNQvtI&{|pRH%*HeO@-TZB1wyQAW4bgOpOIc0000nz(|b^b^rhXx&r_J08EM2LI2Y+!0QP}gTM#r#s2^QNP)xv5C8yMT|r#K"
    "FLP{Rc4cjEWOZz1E_8Tw0A^`yWjX*aF939CWgtdPRVQ;Ga%FRGb#h~6b0A}3Zf<XMAYx@8a%Ev;Iv{jtWpZU8X>%ZMZy;uAY-J!Na{z2_XH#@x"
    "bait@a&m8S0RR90e*"
)
"""Machine code of ``c/resources_path.c``; the last four bytes are the distance to the function that it goes before."""


def wrapper_binaries() -> dict[Path, bytes]:
    """FMI platform and file name → contents.

    Raises `SetupError` if pythonfmu is not there as a whole, as while it is being installed: an FMU without them would
    be kept and could run nowhere."""
    root = Path(pythonfmu.__file__).parent / "resources" / "binaries"
    found = {
        file.relative_to(root): _mended(file.read_bytes()) for file in sorted(root.rglob("*.*"))
    }
    if not found:
        raise SetupError(
            f"pythonfmu: there are no binaries in {root}; install it again: pip install --force-reinstall pythonfmu"
        )
    return found


def _mended(binary: bytes) -> bytes:
    if binary.count(_ENDS) == 1:
        binary = binary.replace(_ENDS, _FAILS)
    if binary[:5] != b"\x7fELF\x02" or struct.unpack_from("<H", binary, 18)[0] != _X86_64:
        return binary
    return _read_any_folder(_release_once(binary))


def _release_once(binary: bytes) -> bytes:
    found = _exported(binary, b"finalizePythonInterpreter")
    if found is None or not binary.startswith(_ENTRY, found[1]):
        return binary
    return _overwrite(binary, found[1] + len(_ENTRY), _RETURN)


def _read_any_folder(binary: bytes) -> bytes:
    """With `_RESOURCES_PATH` in the room behind its machine code, for which masters' fmi2Instantiate is taken."""
    found, segments = _exported(binary, b"fmi2Instantiate"), _segments(binary)
    code = next(
        (
            n
            for n, segment in enumerate(segments)
            if segment[0] == _TO_LOAD and segment[1] & _EXECUTABLE
        ),
        None,
    )
    if found is None or code is None or binary.count(_ESCAPED_BLANK) != 1:
        return binary
    symbol, at = found
    _, _, start, address, size, place = segments[code]
    free = size + -size % 16
    end = start + free + len(_RESOURCES_PATH)
    if end > min(segment[2] for segment in segments if segment[2] > start) or any(
        binary[start + size : end]
    ):
        return binary
    here = address + free + len(_RESOURCES_PATH) - 4
    added = _RESOURCES_PATH[:-4] + struct.pack("<i", at - start + address - here)
    binary = _overwrite(binary, start + free, added)
    binary = _overwrite(binary, symbol + 8, struct.pack("<QQ", address + free, len(added)))
    binary = _overwrite(binary, place + 32, struct.pack("<QQ", end - start, end - start))
    return binary.replace(_ESCAPED_BLANK, _NEVER)  # all is undone by then


def _overwrite(binary: bytes, at: int, what: bytes) -> bytes:
    return binary[:at] + what + binary[at + len(what) :]


def _segments(binary: bytes) -> list[tuple[int, int, int, int, int, int]]:
    """Type, flags, offset, address, size and header's place of every segment of a 64-bit ELF file."""
    (table,) = struct.unpack_from("<Q", binary, 32)
    size, count = struct.unpack_from("<HH", binary, 54)
    places = [table + size * n for n in range(count)]
    return [(*struct.unpack_from("<IIQQ8xQ", binary, place), place) for place in places]


def _exported(binary: bytes, function: bytes) -> tuple[int, int] | None:
    """Offsets of the symbol and of the code of an exported function in a 64-bit ELF file."""
    (table,) = struct.unpack_from("<Q", binary, 40)
    size, count = struct.unpack_from("<HH", binary, 58)
    # of every section: type, address, offset, size, link, size of an entry
    sections = [
        struct.unpack_from("<4xI8xQQQI12xQ", binary, table + size * n) for n in range(count)
    ]
    for kind, _, start, length, link, entry in sections:
        if kind != _DYNAMIC_SYMBOLS:
            continue
        names = sections[link][2]
        for symbol in range(start, start + length, entry):
            name, section, value = struct.unpack_from("<I2xHQ", binary, symbol)
            if binary.startswith(function + b"\0", names + name) and 0 < section < count:
                return symbol, int(value - sections[section][1] + sections[section][2])
    return None
