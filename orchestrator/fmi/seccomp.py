"""A filter of system calls: what an FMU has no need of, and what no other protection covers, is refused with EPERM.

The filter is a program for the kernel's own machine (classic BPF), written here instruction by instruction. It knows
64-bit x86 and ARM."""

import ctypes
import errno
import platform
import struct
from collections.abc import Mapping

from orchestrator.fmi.linux import call, no_new_privileges

_ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
_SECCOMP = {"x86_64": 317, "aarch64": 277}
_SET_FILTER, _ALL_THREADS = 1, 1

_LOAD, _EQUAL, _ANY_BIT, _AND, _RETURN = 0x20, 0x15, 0x45, 0x54, 0x06
_ALLOW, _ERROR = 0x7FFF0000, 0x00050000
_NUMBER, _ARCHITECTURE = 0, 4
_32_BIT_CALLS = 0x40000000  # numbers from here on are those of x32, a second way to every call on x86
_DATAGRAM, _RAW = 2, 3
_TYPE_OF_SOCKET = 0xF
_NEW_NAMESPACES = 0x7E020000

# name: (x86_64, aarch64); None where the architecture has no such call
_ALWAYS = {
    "socket": (41, 198), "io_uring_setup": (425, 425), "io_uring_enter": (426, 426), "io_uring_register": (427, 427),
    "ptrace": (101, 117), "process_vm_readv": (310, 270), "process_vm_writev": (311, 271), "kcmp": (312, 272),
    "pidfd_getfd": (438, 438), "process_madvise": (440, 440), "unshare": (272, 97), "setns": (308, 268),
    "mount": (165, 40), "umount2": (166, 39), "pivot_root": (155, 41), "chroot": (161, 51), "open_tree": (428, 428),
    "move_mount": (429, 429), "fsopen": (430, 430), "fsconfig": (431, 431), "fsmount": (432, 432),
    "fspick": (433, 433), "mount_setattr": (442, 442), "open_tree_attr": (467, 467),
    "add_key": (248, 217), "request_key": (249, 218), "keyctl": (250, 219), "bpf": (321, 280),
    "perf_event_open": (298, 241), "userfaultfd": (323, 282),
    "open_by_handle_at": (304, 265), "init_module": (175, 105), "finit_module": (313, 273),
    "delete_module": (176, 106), "kexec_load": (246, 104), "kexec_file_load": (320, 294), "reboot": (169, 142),
    "swapon": (167, 224), "swapoff": (168, 225), "acct": (163, 89), "quotactl": (179, 60), "settimeofday": (164, 170),
    "clock_settime": (227, 112), "adjtimex": (159, 171), "clock_adjtime": (305, 266), "vhangup": (153, 58),
}  # fmt: skip
_ATTRIBUTES = {
    "chmod": (90, None), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452), "chown": (92, None),
    "fchown": (93, 55), "lchown": (94, None), "fchownat": (260, 54), "utime": (132, None), "utimes": (235, None),
    "futimesat": (261, None), "utimensat": (280, 88), "setxattr": (188, 5), "lsetxattr": (189, 6),
    "fsetxattr": (190, 7), "removexattr": (197, 14), "lremovexattr": (198, 15), "fremovexattr": (199, 16),
    "setxattrat": (463, 463), "removexattrat": (466, 466), "file_setattr": (469, 469),
}  # fmt: skip
_SIGNALS = {
    "tkill": (200, 130), "rt_sigqueueinfo": (129, 138), "rt_tgsigqueueinfo": (297, 240),
    "pidfd_send_signal": (424, 424),
}  # fmt: skip
_MEMORY = {"memfd_create": (319, 279), "memfd_secret": (447, 447), "shmget": (29, 194), "msgget": (68, 186)}
"""What takes memory that counts for no process."""
_IPC = {"shmat": (30, 196), "semget": (64, 190), "mq_open": (240, 180)}
_KILL, _TGKILL = (62, 129), (234, 131)
_OF_A_PROCESS = {
    "prlimit64": (302, 261), "sched_setaffinity": (203, 122), "sched_setscheduler": (144, 119),
    "sched_setparam": (142, 118), "sched_setattr": (314, 274), "migrate_pages": (256, 238), "move_pages": (279, 239),
}  # fmt: skip
"""Their first argument says whose limits, processors or pages are changed; 0 is the caller."""
_OF_SOME_PROCESS = {"setpriority": (141, 140), "ioprio_set": (251, 30)}  # likewise, their second argument
_SOCKETPAIR, _CLONE, _CLONE3, _PRCTL = (53, 199), (56, 220), (435, 435), (157, 167)
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
        _step(_LOAD, _ARCHITECTURE), _step(_EQUAL, _ARCHITECTURES[platform.machine()], 1, 0), _refuse(),
        _step(_LOAD, _NUMBER), _step(_ANY_BIT, _32_BIT_CALLS, 0, 1), _refuse(),
    ]  # fmt: skip

    def only(call_numbers: tuple[int, int], *inner: bytes) -> None:
        """Steps for one call alone; they end with the number loaded again."""
        body = [*inner, _step(_LOAD, _NUMBER)]
        steps.extend([_step(_EQUAL, call_numbers[which], 0, len(body)), *body])

    tables: list[Mapping[str, tuple[int | None, int | None]]] = [
        _ALWAYS, _MEMORY, _ATTRIBUTES if attributes else {}, _IPC if ipc else {}, _SIGNALS if own_process else {},
    ]  # fmt: skip
    for numbers in (numbers for table in tables for numbers in table.values()):
        if (number := numbers[which]) is not None:
            steps += [_step(_EQUAL, number, 0, 1), _refuse()]
    steps += [_step(_EQUAL, _CLONE3[which], 0, 1), _refuse(errno.ENOSYS)]  # its flags lie where no filter can look
    only(_PRCTL, _low_word(0), _step(_EQUAL, _SET_DUMPABLE, 0, 1), _refuse())
    only(_CLONE, _low_word(0), _step(_ANY_BIT, _NEW_NAMESPACES, 0, 1), _refuse())
    only(_SOCKETPAIR, _low_word(1), _step(_AND, _TYPE_OF_SOCKET), _step(_EQUAL, _DATAGRAM, 1, 0),
         _step(_EQUAL, _RAW, 0, 1), _refuse())  # fmt: skip
    if own_process:
        for numbers in (_KILL, _TGKILL) if signals else ():
            only(numbers, _low_word(0), _step(_EQUAL, own_process, 1, 0), _refuse())
        for argument, table in enumerate((_OF_A_PROCESS, _OF_SOME_PROCESS)):
            for numbers in table.values():
                only(numbers, _low_word(argument), _step(_EQUAL, own_process, 2, 0), _step(_EQUAL, 0, 1, 0), _refuse())
    return b"".join([*steps, _step(_RETURN, _ALLOW)])


def filter_calls(*, attributes: bool, ipc: bool, own_process: int | None, signals: bool) -> None:
    """Refuse system calls in every thread of this process and in what they start, for good.

    ``attributes``: whether the mode, the owner, the times and the extended attributes of files are kept from it as
    well, also in its own folder: where no read-only mount protects those of other files.
    ``ipc``: whether semaphores of System V and queues by name are refused: where they are not its own.
    ``own_process``: number of the only process whose limits and priority it may change: its own; None where it sees no
    other.
    ``signals``: whether it may send signals to that process only: where they would reach others."""
    program = _program(own_process, signals=signals and own_process is not None, attributes=attributes, ipc=ipc)
    buffer = ctypes.create_string_buffer(program, len(program))
    head = struct.pack("@HP", len(program) // 8, ctypes.addressof(buffer))
    no_new_privileges()
    call(_SECCOMP[platform.machine()], _SET_FILTER, _ALL_THREADS, head)
