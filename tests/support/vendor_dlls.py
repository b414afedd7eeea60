"""Controllers as IEEE/CIGRE DLLs, written for the tests: sound ones and ones with a planted fault."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.toolchain.compiler import ENDINGS, TARGETS, compile_for

INTERFACE = """
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
union value { char c; const char *s; int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32; uint32_t u32;
    float f; double d; };
struct signal { const char *name, *description, *unit; int type; int32_t width; };
struct parameter { const char *name, *group, *description, *unit; int type; int32_t fixed;
    union value start, low, high; };
struct info { uint8_t version[4]; const char *texts[10]; double sample_time; uint8_t mode;
    int32_t n_in; const struct signal *in; int32_t n_out; const struct signal *out;
    int32_t n_par; const struct parameter *par; int32_t ints, floats, doubles; };
struct instance { void *in, *out, *par; double time; uint8_t mode; const char *error, *message;
    int32_t *ints; float *floats; double *doubles; };
"""

LAG = """
static const struct signal IN[] = {{"u", "Input", "pu", 9, 1}}, OUT[] = {{"y", "Lagged input", "pu", 9, 1}};
static const struct parameter PAR[] = {{"T", "", "Time constant", "s", 9, 0, {.d = 0.01}, {.d = 0.001}, {.d = 10}}};
"""
"""y follows u by a first-order lag of T seconds."""

INFO = """
static const struct info INFO = {{1, 1, 0, 0}, {"%(name)s", "1.0", "A lag"}, %(sample_time)s, 1, 1, IN, 1, OUT, 1, PAR,
    0, 0, %(doubles)s};
const struct info *Model_GetInfo(void) { return &INFO; }
"""

CALLS = """
int32_t Model_Initialize(struct instance *s) { STATE = ((double *)s->out)[0]; BEGIN return 0; }
int32_t Model_Outputs(struct instance *s) {
    STATE += (((double *)s->in)[0] - STATE) * INFO.sample_time / ((double *)s->par)[0];
    ((double *)s->out)[0] = STATE; DO
    return 0;
}
"""


def lag(
    name="lag",
    *,
    state="s->doubles[0]",
    doubles=1,
    sample_time=1e-4,
    begin="",
    do="",
    head="",
    calls=CALLS,
):
    """Source of a lag; ``do`` is run in every sample, ``begin`` in the initialisation."""
    info = INFO % {"name": name, "sample_time": sample_time, "doubles": doubles}
    body = calls.replace("STATE", state).replace("BEGIN", begin).replace("DO", do)
    return INTERFACE + LAG + info + head + body


EXPORTED = "#pragma GCC visibility push(default)\n"
"""A vendor's library exports all of its functions; ours hide what is not marked."""


def compiled(source, folder, name="controller", platform="linux64"):
    """The library of a source that includes the system's headers alone, in a folder; kept in the cache of libraries.

    With a library's flags: by others zig would build its C and runtime libraries once more, in a minute.
    """
    library = folder / f"{name}{ENDINGS[platform]}"
    kept = compile_for(EXPORTED + source, TARGETS[platform][0], ENDINGS[platform])
    library.write_bytes(kept.read_bytes())
    return library


DROOP = """
struct in { double i[3], p_ref, v_ref; }; struct out { double e[3], p; }; struct par { double mp, tau, V, S, f; };
static const struct signal IN[] = {{"i", "Bridge currents", "kA", 9, 3}, {"p_ref", "", "pu", 9, 1},
    {"v_ref", "", "pu", 9, 1}}, OUT[] = {{"e", "Voltages demanded", "kV", 9, 3}, {"p", "Power", "pu", 9, 1}};
static const struct parameter PAR[] = {{"mp", "", "Droop", "pu", 9, 0, {.d = 0.02}, {.d = 0}, {.d = 1}},
    {"tau", "", "Power filter", "s", 9, 0, {.d = 0.05}, {.d = 1e-4}, {.d = 10}},
    {"V", "", "Rated voltage", "kV", 9, 0, {.d = 0.69}, {.d = 0}, {.d = 100}},
    {"S", "", "Rating", "MVA", 9, 0, {.d = 2}, {.d = 0}, {.d = 1000}},
    {"f", "", "Frequency", "Hz", 9, 0, {.d = 50}, {.d = 1}, {.d = 100}}};
static const struct info INFO = {{1, 1, 0, 0}, {"droop", "1.0", "Grid-forming droop"}, SAMPLE, 1, 3, IN, 2, OUT, 5, PAR,
    0, 0, 3};
const struct info *Model_GetInfo(void) { return &INFO; }
int32_t Model_Initialize(struct instance *s) { s->doubles[0] = s->doubles[1] = s->doubles[2] = 0; return 0; }
int32_t Model_Outputs(struct instance *s) {
    const struct in *u = s->in; struct out *y = s->out; const struct par *p = s->par;
    const double turn = 6.283185307179586, peak = u->v_ref * p->V * sqrt(2.0 / 3.0);
    double power = 0, *theta = s->doubles, *filtered = s->doubles + 1;
    HIDE
    for (int k = 0; k < 3; ++k) {
        y->e[k] = peak * cos(*theta - k * turn / 3);
        power += y->e[k] * u->i[k] / p->S;
    }
    *filtered += (power - *filtered) * SAMPLE / p->tau;
    *theta += SAMPLE * turn * p->f * (1 + p->mp * (u->p_ref - *filtered));
    WRAP
    y->p = *filtered;
    s->doubles[2] = s->time;
    return 0;
}
"""
"""A grid-forming droop: kA in, kV out, per phase; its third state is a clock."""

DEVICE = """
dll = "droop.so"
filter = "L"
delay = {delay}
[unit]
S_n = 2.0
V_n = 0.69
[circuit]
S_n = 2.0
filter.R = 0.01
filter.X = 0.15
transformer.R = 0.005
transformer.X = 0.1
[inputs]
"i[1]" = "i_s_a"
"i[2]" = "i_s_b"
"i[3]" = "i_s_c"
p_ref = "P_ref"
v_ref = "V_ref"
[bridge]
voltage = ["e[1]", "e[2]", "e[3]"]
"""


@cache
def _library(source, platform):
    with TemporaryDirectory() as folder:
        return compiled(source, Path(folder), platform=platform).read_bytes()


def droop_device(
    folder,
    *,
    sample=1e-4,
    delay=0,
    wrap="*theta = fmod(*theta, turn);",
    hide="",
    changes=(),
    platform="linux64",
):
    """File of a device: the droop behind an inductor and a transformer.

    ``changes`` replace text in it; ``hide`` may put the filtered power elsewhere.
    """
    source = INTERFACE + DROOP.replace("SAMPLE", repr(sample)).replace("WRAP", wrap).replace(
        "HIDE", hide
    )
    (folder / f"droop{ENDINGS[platform]}").write_bytes(_library(source, platform))
    text = DEVICE.format(delay=delay).replace("droop.so", f"droop{ENDINGS[platform]}")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "droop.toml"
    file.write_text(text, encoding="utf-8")
    return file
