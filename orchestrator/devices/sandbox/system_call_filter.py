"""A filter of system calls: what an FMU has no need of, and what no other protection covers, is refused with EPERM.

The filter is a program for the kernel's own machine (classic BPF), written here instruction by instruction. It knows
64-bit x86 and ARM."""

import ctypes
import errno
import platform
import struct
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from orchestrator.devices.sandbox.kernel_calls import call, no_new_privileges

_ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
_SECCOMP = {"x86_64": 317, "aarch64": 277}
_SET_FILTER = 1
_ALL_THREADS = 1

_LOAD = 0x20
_EQUAL = 0x15
_ANY_BIT = 0x45
_AND = 0x54
_RETURN = 0x06
_ALLOW = 0x7FFF0000
_ERROR = 0x00050000
_NUMBER = 0
_ARCHITECTURE = 4
# numbers from here on are those of x32, a second way to every call on x86
_32_BIT_CALLS = 0x40000000
_DATAGRAM = 2
_RAW = 3
_TYPE_OF_SOCKET = 0xF
_NEW_NAMESPACES = 0x7E020000

_CALLS: Mapping[str, Mapping[str, Sequence[int]]] = tomllib.loads(
    Path(__file__).with_name("system_calls.toml").read_text(encoding="utf-8")
)

_KILL, _TGKILL = (62, 129), (234, 131)
_NEWEST = 469
"""Newest call that is known here, of Linux 6.18; C libraries take a newer one for absent, and have another way.

A list of allowed calls instead of refused ones would break honest FMUs: what Python, glibc, Wine, Fortran's and Java's
libraries call changes with their versions, and no machine has them all to try. What came after the list, nobody needs
yet."""
_NEW, _AT_LEAST = _NEWEST + 1, 0x35
_SOCKETPAIR, _CLONE, _CLONE3, _PRCTL = (53, 199), (56, 220), (435, 435), (157, 167)
_FCNTL, _OF_FCNTL = (72, 25), 1  # by its second argument
_SET_LEASE = 1024
_NOTIFY = 1026  # hold up whoever opens a file, and tell of a folder's changes
_SET_DUMPABLE = 4  # an option of prctl by which a process hides what it has in use


def _step(code: int, value: int, then: int = 0, otherwise: int = 0) -> bytes:
    return struct.pack("<HBBI", code, then, otherwise, value & 0xFFFFFFFF)


def _refuse(number: int = errno.EPERM) -> bytes:
    return _step(_RETURN, _ERROR | number)


def _low_word(argument: int) -> bytes:
    return _step(_LOAD, 16 + 8 * argument)


def _program(own_process: int | None, *, signals: bool, attributes: bool, ipc: bool) -> bytes:
    which = list(_ARCHITECTURES).index(platform.machine())
    steps = [
        _step(_LOAD, _ARCHITECTURE),
        _step(_EQUAL, _ARCHITECTURES[platform.machine()], 1, 0),
        _refuse(),
        _step(_LOAD, _NUMBER),
        _step(_ANY_BIT, _32_BIT_CALLS, 0, 1),
        _refuse(),
        _step(_AT_LEAST, _NEW, 0, 1),
        _refuse(errno.ENOSYS),
    ]

    def only(call_numbers: Sequence[int], *inner: bytes) -> None:
        """Steps for one call alone; they end with the number loaded again."""
        body = [*inner, _step(_LOAD, _NUMBER)]
        steps.extend([_step(_EQUAL, call_numbers[which], 0, len(body)), *body])

    wanted = {
        "always": True,
        "memory": True,
        "of_all": True,
        "of_others": True,
        "attributes": attributes,
        "ipc": ipc,
        "signals": bool(own_process),
    }
    for numbers in (
        numbers for group in wanted if wanted[group] for numbers in _CALLS[group].values()
    ):
        number = numbers[which]
        if number >= 0:
            steps += [_step(_EQUAL, number, 0, 1), _refuse()]
    # its flags lie where no filter can look
    steps += [_step(_EQUAL, _CLONE3[which], 0, 1), _refuse(errno.ENOSYS)]
    only(
        _FCNTL,
        _low_word(_OF_FCNTL),
        _step(_EQUAL, _SET_LEASE, 1, 0),
        _step(_EQUAL, _NOTIFY, 0, 1),
        _refuse(),
    )
    only(_PRCTL, _low_word(0), _step(_EQUAL, _SET_DUMPABLE, 0, 1), _refuse())
    only(_CLONE, _low_word(0), _step(_ANY_BIT, _NEW_NAMESPACES, 0, 1), _refuse())
    only(
        _SOCKETPAIR,
        _low_word(1),
        _step(_AND, _TYPE_OF_SOCKET),
        _step(_EQUAL, _DATAGRAM, 1, 0),
        _step(_EQUAL, _RAW, 0, 1),
        _refuse(),
    )
    if own_process:
        for numbers in (_KILL, _TGKILL) if signals else ():
            only(numbers, _low_word(0), _step(_EQUAL, own_process, 1, 0), _refuse())
        for argument, group in enumerate(("of_a_process", "of_some_process")):
            for numbers in _CALLS[group].values():
                only(
                    numbers,
                    _low_word(argument),
                    _step(_EQUAL, own_process, 2, 0),
                    _step(_EQUAL, 0, 1, 0),
                    _refuse(),
                )
    return b"".join([*steps, _step(_RETURN, _ALLOW)])


def filter_calls(*, attributes: bool, ipc: bool, own_process: int | None, signals: bool) -> None:
    """Refuse system calls in every thread of this process and in what they start, for good.

    ``attributes``: whether the mode, the owner, the times and the extended attributes of files are kept from it as
    well, also in its own folder: where no read-only mount protects those of other files.
    ``ipc``: whether semaphores of System V and queues by name are refused: where they are not its own.
    ``own_process``: number of the only process whose limits and priority it may change: its own; None where it sees no
    other.
    ``signals``: whether it may send signals to that process only: where they would reach others."""
    program = _program(
        own_process, signals=signals and own_process is not None, attributes=attributes, ipc=ipc
    )
    buffer = ctypes.create_string_buffer(program, len(program))
    head = struct.pack("@HP", len(program) // 8, ctypes.addressof(buffer))
    no_new_privileges()
    call(_SECCOMP[platform.machine()], _SET_FILTER, _ALL_THREADS, head)
