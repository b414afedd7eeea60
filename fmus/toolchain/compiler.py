"""A C compiler without a system compiler: ziglang from PyPI, its results kept between runs.

A released wheel brings the orchestrator's own libraries for every platform in the folder ``prebuilt``, so that running
FMUs needs no compiler."""

import os
import re
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from fmus.toolchain import windows
from fmus.toolchain.cache import cache_directory, intact, keep, key_of
from fmus.toolchain.extras import installed_version, require
from fmus.toolchain.temporary import own_folder, remove, sweep_partial_files

TARGETS = {
    # FMI platform -> zig targets of the machines with this platform
    "linux64": ("x86_64-linux-gnu.2.17",),
    "win64": ("x86_64-windows-gnu",),
    "darwin64": ("x86_64-macos", "aarch64-macos"),
}

ENDINGS = {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib"}  # of a shared library

FLAGS = (
    *("-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-sanitize=undefined", "-g0", "-s"),
    # nor fast-math: a compiled kernel and its Python fallback agree to rounding
    "-ffp-contract=off",
    # LLVM 22 was seen to unroll a loop in one run and not in the next, and is known to vectorise so
    # (llvm/llvm-project#200833): an FMU would not be the same file on each machine. It costs a grid's step 4 %.
    *("-fno-unroll-loops", "-fno-vectorize"),
)
"""Flags of every library."""

# Without a name of its own a Mac library would carry the path of the temporary folder.
_MAC_NAME = "@rpath/library.dylib"
_MAC_FLAGS = (f"-Wl,-install_name,{_MAC_NAME}",)


WASM = "wasm32-wasi"
"""The zig target of `fmus.toolchain.component`. Its code calls nothing of WASI, as it neither reads nor writes."""

_WASM_FLAGS = ("-mexec-model=reactor",)  # a library, whose functions its host calls
_NOT_WASM = ("-shared", "-fPIC", "-fvisibility=hidden")

_OWN_HEADER = re.compile(r'#include "(\w+\.[ch])"\s*$')

_PREBUILT = Path(__file__).with_name("prebuilt")


@cache
def recipe() -> tuple[str, ...]:
    """Everything except the source that determines a library's contents. It is part of every hash that names a
    library."""
    return (*FLAGS, *_MAC_FLAGS, f"ziglang {installed_version('ziglang')}")


def host_platform() -> str | None:
    """FMI name of this machine's platform, where the compiler has a target for it."""
    return {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform)


def compile_library(source: str, platform: str) -> Path:
    """Compile C source to a shared library, or return the library that was compiled from it before.

    Where a platform stands for several machines, the library holds code for each (a universal binary).

    ``source``: One translation unit.
    ``platform``: A key of `TARGETS`."""
    if platform not in TARGETS:
        raise ValueError(
            f"the compiler has no target for platform {platform!r}; choose from {', '.join(TARGETS)}"
        )
    targets, ending = TARGETS[platform], ENDINGS[platform]
    if len(targets) == 1:
        return compile_for(source, targets[0], ending)
    thin = [compile_for(source, target, ending) for target in targets]
    library = thin[0].with_name(f"{thin[0].stem}_universal{ending}")
    return (
        library
        if intact(library)
        else keep(library, universal_binary([path.read_bytes() for path in thin]))
    )


def compile_here(*files: Path) -> Path:
    """Compile files of C, as one (`joined_source`), for this machine, or return the library of the package."""
    platform = host_platform()
    if platform is None:
        raise RuntimeError("there is no compiler for this platform")
    return library_of(platform, *files)


def library_of(platform: str, *files: Path) -> Path:
    """Compile files of C, as one, for a platform, or return the library of the package."""
    source = joined_source(*files)
    brought = _prebuilt(source, platform)
    return brought if brought.exists() else compile_library(source, platform)


def prebuild(*files: Path) -> None:
    """Compile files of C, as one, for every platform into the folder that a released wheel takes along."""
    source = joined_source(*files)
    for platform in TARGETS:
        library = _prebuilt(source, platform)
        library.parent.mkdir(parents=True, exist_ok=True)
        library.write_bytes(compile_library(source, platform).read_bytes())
        library.chmod(0o755)


def _prebuilt(source: str, platform: str) -> Path:
    """Path of a source's library in the package, if the package contains one. Another source gives another name."""
    key = key_of(source, platform, *FLAGS, *_MAC_FLAGS)
    return _PREBUILT / f"{key}{ENDINGS[platform]}"


def joined_source(*files: Path) -> str:
    """Files of C as one text, with those that they include of the toolchain's written in; messages name the line."""

    def header(match: re.Match[str]) -> str:
        return joined_source(Path(__file__).parent / "c" / match[1])

    parts = []
    for file in files:
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        parts.append(f'#line 1 "{file.name}"\n')
        for number, line in enumerate(lines, start=2):
            match = _OWN_HEADER.match(line)
            parts.append(f'{header(match)}#line {number} "{file.name}"\n' if match else line)
    return "".join(parts)


def compile_for(source: str, target: str, ending: str, libraries: Sequence[str] = ()) -> Path:
    """Compile C source for one zig target; otherwise as `compile_library`.

    ``source``: One translation unit.
    ``target``: One of those of a platform in `TARGETS`, or `WASM`.
    ``ending``: Of the library's file, such as ``.so``; ``.exe`` makes a program.
    ``libraries``: Of the system, that the source needs beside the C library and its mathematics, such as ``dl``."""
    require("compiling C", "ziglang")
    own = _WASM_FLAGS if target == WASM else ()
    parts = [source, target, *recipe(), *own, *libraries]
    library = cache_directory("libraries") / f"{key_of(*parts)}{ending}"
    if intact(library):
        return library
    sweep_partial_files(cache_directory("libraries").parent)
    folder = own_folder("compile")
    try:
        (folder / _SOURCE).write_text(source, encoding="utf-8")
        built = folder / f"library{ending}"
        for way in _ways(target, ending, libraries, built):
            said = _run(way, folder)
            if said is None:
                return keep(library, built.read_bytes())
            if _NOT_C.search(said):
                break
        raise RuntimeError(f"the C compiler (ziglang) failed for {target}:\n{said}")
    finally:
        remove(folder)


def _run(commands: Sequence[Sequence[str]], folder: Path) -> str | None:
    """Run zig's commands one after the other in a folder; return what the first that fails says."""
    for command in commands:
        result = subprocess.run(
            [str(_zig()), *command], capture_output=True, text=True, check=False, cwd=folder
        )
        if result.returncode != 0:
            return result.stderr.strip()
    return None


_SOURCE = "source.c"  # what messages of the compiler name
_NOT_C = re.compile(rf"^{re.escape(_SOURCE)}:\d+:\d+: (fatal )?error: ", re.MULTILINE)
_OBJECT = "source.obj"

# a call of the runtime library is an error at once; the rest is as `zig cc` has it for `FLAGS`
_WITHOUT_RUNTIME = ("-fno-compiler-rt", "-O", "ReleaseFast", "-fstrip")
_WITHOUT_RUNTIME_FOR = {
    "linux": (*_WITHOUT_RUNTIME, "-z", "defs", "-fno-soname"),
    "macos": (*_WITHOUT_RUNTIME, "-install_name", _MAC_NAME),
}


def _ways(
    target: str, ending: str, libraries: Sequence[str], built: Path
) -> Iterator[list[list[str]]]:
    """Yield ways to make a library, to be tried one after the other: commands of zig; each way that succeeds writes the
    same bytes.

    What zig brings as source, it compiles once in each new environment. So a library for Linux or a Mac is first linked
    without its runtime library (4 s of processor for each), which our code calls nothing of, and one for Windows with
    those files alone of mingw's C library (100 s as a whole) that our code uses. Code that needs more is linked as all
    other."""
    linked = ["-lm", *(f"-l{name}" for name in libraries)]
    flags = _flags(target, ending)
    own = [flag for flag in flags if flag not in ("-shared", *_MAC_FLAGS)]
    system = target.split("-")[1]
    if system in _WITHOUT_RUNTIME_FOR and ending in ENDINGS.values():
        yield [
            [
                *("build-lib", "-dynamic", "-target", target, *_WITHOUT_RUNTIME_FOR[system]),
                *("-lc", *linked, f"-femit-bin={built}", "-cflags", *own, "--", _SOURCE),
            ]
        ]
    runtime = [] if libraries else _windows_runtime(target, ending)
    if runtime:
        yield [
            ["cc", "-target", target, *own, "-c", _SOURCE, "-o", _OBJECT],
            windows.link_command(target, ending, _OBJECT, runtime, built),
        ]
    yield [["cc", "-target", target, *flags, _SOURCE, "-o", str(built), *linked]]


def _windows_runtime(target: str, ending: str) -> list[Path]:
    """Return what a library for Windows is linked with; nothing for another target or with another zig."""
    if target not in windows.MACHINES or installed_version("ziglang") != windows.CHECKED_ZIG:
        return []
    key = key_of(target, ending, *recipe(), *windows.RUNTIME_RECIPE)
    names = windows.runtime_files(ending)
    kept = [cache_directory("libraries") / key / name for name in names]
    if all(intact(path) for path in kept):
        return kept
    folder = own_folder("compile")
    try:
        sources = Path(os.environ.get("ZIG_LIB_DIR") or _zig().with_name("lib"))
        if _run(windows.runtime_commands(target, ending, sources, folder), folder) is not None:
            return []
        return [
            keep(path, (folder / name).read_bytes()) for path, name in zip(kept, names, strict=True)
        ]
    finally:
        remove(folder)


@cache
def _zig() -> Path:
    """The compiler itself: ``python -m ziglang`` starts it too, and costs the start of a Python each time."""
    spec = find_spec("ziglang")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).with_name("zig")


def _flags(target: str, ending: str) -> list[str]:
    if target == WASM:
        return [flag for flag in FLAGS if flag not in _NOT_WASM] + [*_WASM_FLAGS]
    flags = [*FLAGS, *_MAC_FLAGS] if target.endswith("macos") else [*FLAGS]
    if ending == ".exe":
        flags.remove("-shared")
    return flags


_MAGIC = 0xCAFEBABE
# alignment of each library in the file, as a power of two: the page size of the newer processors
_ALIGNMENT = 14
_THIN = b"\xcf\xfa\xed\xfe"


def universal_binary(libraries: Sequence[bytes]) -> bytes:
    """Join thin 64-bit libraries, one per processor."""
    step = 1 << _ALIGNMENT
    header, body = struct.pack(">II", _MAGIC, len(libraries)), b""
    offset = step
    for library in libraries:
        if library[:4] != _THIN:
            raise ValueError("a universal binary is made of thin 64-bit Mach-O files")
        processor, variant = struct.unpack("<II", library[4:12])
        header += struct.pack(">IIIII", processor, variant, offset, len(library), _ALIGNMENT)
        padded = library + bytes(-len(library) % step)
        body += padded
        offset += len(padded)
    return header + bytes(step - len(header)) + body
