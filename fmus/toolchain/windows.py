"""Linking for Windows with the few files of mingw's C library that a library of ours uses.

zig compiles all of that library, 300 files, before it links the first library for Windows on a machine. Here the same
files with the same flags become the same objects, and the library linked from them is the same to the last byte."""

from collections.abc import Sequence
from pathlib import Path

CHECKED_ZIG = "0.17.1"
"""The zig whose own libraries these were compared with. Another may have other files, or other flags for them."""

MACHINES = {
    # zig target -> dlltool's name of the machine
    "x86-windows-gnu": "i386",
    "x86_64-windows-gnu": "i386:x86-64",
}

_SOURCE_FILES = (
    # of a library
    *("misc/dllmain.c", "misc/ucrt_amsg_exit.c", "math/fpclassify.c"),
    *("misc/fegetenv.c", "misc/fesetenv.c", "misc/mingw_controlfp.c", "misc/mingw_setfp.c"),
    *("crt/CRT_fp10.c", "crt/cinitexe.c", "crt/gccmain.c", "crt/mingw_helpers.c", "crt/natstart.c"),
    *("crt/pesect.c", "crt/pseudo-reloc.c", "crt/pseudo-reloc-list.c"),
    *("crt/tlsmcrt.c", "crt/tlssup.c", "crt/tlsthrd.c"),
    *("stdio/ucrt_fprintf.c", "stdio/ucrt_vfprintf.c", "stdio/ucrt___local_stdio_printf_options.c"),
    *("stdio/ucrt_snprintf.c", "stdio/ucrt_vsnprintf.c", "stdio/ucrt_printf.c"),
    # what zig's runtime library defines as well, where mingw's is the one that counts
    *("math/fmal.c", "math/x86/cossinl.c", "math/x86/exp2l.S", "math/x86/expl.c"),
    *("math/x86/internal_logl.S", "math/x86/log10l.S", "math/x86/log2l.S", "math/x86/logl.c"),
)
_SOURCE_FILES_OF_PROGRAMS = (
    *("crt/_newmode.c", "crt/crt_handler.c", "crt/dllargv.c", "crt/merr.c", "crt/usermatherr.c"),
    *("crt/wildcard.c", "crt/xncommod.c", "crt/xthdloc.c", "crt/xtxtmode.c"),
    *("misc/__initenv.c", "misc/__p___initenv.c", "misc/mingw_matherr.c"),
    "misc/ucrt__getmainargs.c",
)

_IMPORTS = {
    # Names of Windows alone, in the order in which zig links these libraries: code that uses another name is not
    # linked, rather than with something else than mingw's function of that name.
    "api-ms-win-crt-convert-l1-1-0.dll": "atof atoi atoll strtod",
    "api-ms-win-crt-environment-l1-1-0.dll": "__p__environ getenv",
    "api-ms-win-crt-heap-l1-1-0.dll": "_set_new_mode calloc free malloc realloc",
    "api-ms-win-crt-locale-l1-1-0.dll": "_configthreadlocale",
    "api-ms-win-crt-math-l1-1-0.dll": "__setusermatherr acos asin atan atan2 cosh hypot nearbyint pow "
    "remainder sinh tanh",
    "api-ms-win-crt-private-l1-1-0.dll": "memchr strchr strrchr strstr",
    "api-ms-win-crt-runtime-l1-1-0.dll": "__p___argc __p___argv _cexit _configure_narrow_argv _crt_atexit "
    "_execute_onexit_table _exit _initialize_narrow_environment _initialize_onexit_table _initterm _initterm_e "
    "_register_onexit_function _seh_filter_exe _set_app_type _set_invalid_parameter_handler abort exit "
    "_XcptFilter==_seh_filter_exe __set_app_type==_set_app_type",
    "api-ms-win-crt-stdio-l1-1-0.dll": "__acrt_iob_func __p__commode __p__fmode __stdio_common_vfprintf "
    "__stdio_common_vsprintf _wfopen fclose fflush fgets fopen fputc fputs fread fseek ftell fwrite puts rewind "
    "setvbuf",
    "api-ms-win-crt-string-l1-1-0.dll": "strcmp strcpy strncmp strncpy",
    "KERNEL32.dll": "CloseHandle@4 CopyFileA@12 CreateFileA@28 CreateFileMappingA@24 CreateFileW@28 CreateThread@24 "
    "DeleteCriticalSection@4 DeleteFileA@4 EnterCriticalSection@4 ExitProcess@4 FreeLibrary@4 "
    "GetExitCodeProcess@8 GetLastError@0 GetModuleFileNameA@12 GetModuleFileNameW@12 GetModuleHandleA@4 "
    "GetModuleHandleExA@12 GetModuleHandleExW@12 GetModuleHandleW@4 GetProcAddress@8 GetTempFileNameA@16 "
    "GetTempPathA@8 InitializeCriticalSection@4 LeaveCriticalSection@4 LoadLibraryA@4 LoadLibraryExW@12 LoadLibraryW@4 "
    "MapViewOfFile@20 MoveFileExA@12 MultiByteToWideChar@24 QueryPerformanceCounter@4 "
    "QueryPerformanceFrequency@4 SetErrorMode@4 SetUnhandledExceptionFilter@4 Sleep@4 TlsGetValue@4 "
    "VirtualProtect@16 VirtualQuery@12 WaitForSingleObject@8 WriteFile@20",
}

_DEFINITIONS = (  # as zig has them for mingw's files
    *("-w", "-std=gnu11", "-D__USE_MINGW_ANSI_STDIO=0", "-ffunction-sections", "-fdata-sections"),
    *("-fno-omit-frame-pointer", "-D__MSVCRT_VERSION__=0x700", "-D_CRTBLD", "-D_SYSCRT=1"),
    *("-D_WIN32_WINNT=0x0f00", "-DCRTDLL=1", "-DHAVE_CONFIG_H"),
)
_STRIPPED = ("-O", "ReleaseFast", "-fstrip")  # as `zig cc` has it for a library's flags
# A library that marks no function for export exports all but those of files with these names.
_STARTS = {".dll": "dllcrt2.obj", ".exe": "crt2.obj"}
_MINGW = "libmingw32.lib"


def runtime_files(ending: str) -> list[str]:
    """Return the names of what `runtime_commands` writes, in the order in which it is linked."""
    return [_STARTS[ending], _MINGW, *(f"imports{number}.lib" for number in range(len(_IMPORTS)))]


RUNTIME_RECIPE = (*_SOURCE_FILES, *_SOURCE_FILES_OF_PROGRAMS, *_DEFINITIONS, repr(_IMPORTS))
"""What the runtime files are made from, beside zig's own sources."""


def runtime_commands(target: str, ending: str, sources: Path, folder: Path) -> list[list[str]]:
    """Write lists of imports into a folder, and return zig's arguments that make the runtime files there.

    ``target``: Of `MACHINES`.
    ``ending``: ``.dll`` or ``.exe``, whose runtime files differ.
    ``sources``: Folder ``lib`` of zig.
    ``folder``: Where the commands are to be run."""
    mingw, program = sources / "libc" / "mingw", ending == ".exe"
    headers = [
        *("-isystem", str(sources / "libc" / "include" / "any-windows-any")),
        *("-I", str(mingw / "include")),
    ]
    flags = ["-cflags", *_DEFINITIONS, *headers]
    files = [*_SOURCE_FILES, *(_SOURCE_FILES_OF_PROGRAMS if program else ())]
    own = ["-fno-function-sections"] if program else []
    start = "crt/crtexe.c" if program else "crt/crtdll.c"
    common = ["-target", target, *_STRIPPED, "-fno-compiler-rt"]
    commands = [
        [
            "build-obj",
            *common,
            f"-femit-bin={_STARTS[ending]}",
            *flags,
            *own,
            "--",
            str(mingw / start),
        ],
        [
            *("build-lib", "-static", *common, f"-femit-bin={_MINGW}", *flags, "--"),
            *(str(mingw / file) for file in files),
        ],
    ]
    decorated = target.startswith("x86-")  # names end with the bytes of their arguments
    for number, (library, names) in enumerate(_IMPORTS.items()):
        exported = [name if decorated else name.split("@")[0] for name in names.split()]
        definition = folder / f"imports{number}.def"
        definition.write_text("\n".join(["EXPORTS", *exported, ""]), encoding="ascii")
        commands.append(
            [
                *("dlltool", "-k", "-m", MACHINES[target], "-d", definition.name, "-D", library),
                *("-l", f"imports{number}.lib"),
            ]
        )
    return commands


def link_command(
    target: str, ending: str, source: str, runtime: Sequence[Path], built: Path
) -> list[str]:
    """Return zig's arguments that link an object with the runtime files."""
    program = ending == ".exe"
    kind = (
        ["build-exe", "-fentry=mainCRTStartup"] if program else ["build-lib", "-dynamic", "-fPIC"]
    )
    files = [source, *map(str, runtime)]
    return [*kind, "-target", target, *_STRIPPED, *files, f"-femit-bin={built}"]
