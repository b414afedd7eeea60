"""Programs of tests in C, such as a host that loads a library."""

from fmus.toolchain.compiler import compile_for


def compiled_program(source, target):
    """The program of a C file for a zig target, kept in the cache of libraries.

    With a library's flags: zig builds its C library for Windows, some 300 files, anew for a program with debug
    information.
    """
    return compile_for(source.read_text(encoding="utf-8"), target, ".exe")
