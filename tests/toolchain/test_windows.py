"""Libraries for Windows, linked with few of mingw's files: the same to the last byte as with all of them."""

from inspect import unwrap
from pathlib import Path

import pytest

from fmus.toolchain import windows
from fmus.toolchain.compiler import _run, _ways, compile_for
from fmus.toolchain.extras import installed_version

CONSTRAINTS = Path(__file__).parents[2] / ".ci" / "constraints.txt"

USUAL = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <windows.h>
#ifdef PROGRAM
int main(int n, char **words) {
    double x = n;
#else
__attribute__((visibility("default"))) int usual(double x, char **words) {
#endif
    char *text = calloc(99, 1);
    const double all = sin(x) + cos(x) + tan(x) + exp(x) + log(x) + sqrt(x) + fmod(x, 3) + floor(x) + ceil(x) + fabs(x)
        + pow(x, 1.5) + atan2(x, 2) + asin(x / 9) + acos(x / 9) + atan(x) + sinh(x) + cosh(x) + tanh(x) + hypot(x, 1);
    snprintf(text, 99, "%.17g %s", all, words[0]);
    FILE *file = fopen(words[1], "wb");
    if (!file || !strchr(text, '.') || !isfinite(all)) return (int)GetLastError();
    fwrite(text, 1, strlen(text), file);
    printf("%s", text);
    return fclose(file);
}
"""
UNUSUAL = {
    "of mingw alone": """
#include <dirent.h>
__attribute__((visibility("default"))) int first(const char *folder) { return readdir(opendir(folder))->d_namlen; }
""",
    "of zig's runtime library as well": """
#include <math.h>
__attribute__((visibility("default"))) long double power(long double x) { return expl(x); }
""",
}

KINDS = [(target, ".dll") for target in windows.MACHINES] + [("x86_64-windows-gnu", ".exe")]


def source_of(ending):
    return f"#define PROGRAM\n{USUAL}" if ending == ".exe" else USUAL


def ways(source, target, ending, folder):
    """The ways of a source, to be run in the folder."""
    (folder / "source.c").write_text(source, encoding="utf-8")
    return list(unwrap(_ways)(target, ending, (), folder / f"library{ending}"))


@pytest.fixture
def checked_zig():
    """Skips with a zig whose own libraries were not compared."""
    if installed_version("ziglang") != windows.CHECKED_ZIG:
        pytest.skip(f"only ziglang {windows.CHECKED_ZIG} links with few files")


def test_the_zig_of_ci_is_the_one_whose_libraries_were_compared():
    assert f"ziglang=={windows.CHECKED_ZIG}" in CONSTRAINTS.read_text(encoding="utf-8").split()


@pytest.mark.slow
@pytest.mark.parametrize(("target", "ending"), KINDS)
def test_usual_code_is_linked_with_few_files(checked_zig, target, ending, tmp_path):
    few, _ = ways(source_of(ending), target, ending, tmp_path)
    assert _run(few, tmp_path) is None
    kept = compile_for(source_of(ending), target, ending)
    assert (tmp_path / f"library{ending}").read_bytes() == kept.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("code", UNUSUAL)
def test_code_that_needs_another_file_is_not_linked_without_it(checked_zig, code, tmp_path):
    few, _ = ways(UNUSUAL[code], "x86_64-windows-gnu", ".dll", tmp_path)
    assert "undefined symbol" in _run(few, tmp_path)


@pytest.mark.slow
def test_another_zig_links_with_all_files(checked_zig, monkeypatch, tmp_path):
    monkeypatch.setattr(windows, "CHECKED_ZIG", "0.0.0")
    assert len(ways(USUAL, "x86_64-windows-gnu", ".dll", tmp_path)) == 1


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize(("target", "ending"), KINDS)
def test_few_files_give_the_same_bytes_as_all(checked_zig, target, ending, tmp_path):
    made = []
    for way in ways(source_of(ending), target, ending, tmp_path):
        assert _run(way, tmp_path) is None
        made.append((tmp_path / f"library{ending}").read_bytes())
    assert len(made) == 2
    assert made[0] == made[1]
