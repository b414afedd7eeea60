"""A vendor's exciter beside a machine: what the user is told to type for its start."""

import pytest

from orchestrator.studies.modes.modes import compute_modes
from tests.support.scenarios import prepare_one
from tests.support.vendor_dlls import INTERFACE, compiled

EXCITER = (
    INTERFACE
    + """
struct in { double v_ref, v; }; struct out { double E; };
static const struct signal IN[] = {{"v_ref", "", "pu", 9, 1}, {"v", "", "pu", 9, 1}}, OUT[] = {{"E", "", "pu", 9, 1}};
static const struct parameter PAR[] = {{"K", "", "", "pu", 9, 0, {.d = 50}, {.d = 1}, {.d = 500}}};
static const struct info INFO = {{1, 1, 0, 0}, {"exciter", "1.0"}, 1e-3, 3, 2, IN, 1, OUT, 1, PAR, 0, 0, 1};
const struct info *Model_GetInfo(void) { return &INFO; }
int32_t Model_Initialize(struct instance *s) { s->doubles[0] = ((struct out *)s->out)->E; return 0; }
int32_t Model_Outputs(struct instance *s) {
    const struct in *u = s->in;
    s->doubles[0] += (*(double *)s->par * (u->v_ref - u->v) - s->doubles[0]) * 1e-3 / 0.05;
    ((struct out *)s->out)->E = s->doubles[0];
    return 0;
}
"""
)

CASE = """
name = "external"
[solver]
step_size = "1 ms"
stop_time = "1 s"
groups = [["avr"], ["gen"], ["bus"]]
[components.gen]
model = "synchronous_generator"
exciter = "external"
parameters = { S_n = "1500 MVA", P_0 = 0.8, v_0 = 1.0, Q_0 = 0.2 }
[components.bus]
model = "infinite_bus"
parameters = { P_0 = 12.0, Q_0 = 3.0, v_0 = 1.0 }
[components.avr]
dll = "exciter.so"
parameters = { initial.E = START }
inputs = { v_ref = REFERENCE }
[[connections]]
from = "gen.v_t"
to = "avr.v"
[[connections]]
from = "avr.E"
to = "gen.exciter.E_fd"
"""
for name in ("v_re", "v_im"):
    CASE += f'[[connections]]\nfrom = "bus.{name}"\nto = "gen.{name}"\n'
for name in ("i_re", "i_im"):
    CASE += f'[[connections]]\nfrom = "gen.{name}"\nto = "bus.{name}"\n'
CASE += '[scenarios.base]\ntitle = "Base"\n'


def warned(folder, start, reference):
    """Warnings of the case with these numbers."""
    path = folder / "case.toml"
    path.write_text(
        CASE.replace("START", repr(start)).replace("REFERENCE", repr(reference)), encoding="utf-8"
    )
    prepared = prepare_one(path)
    return compute_modes(prepared).warnings


@pytest.mark.slow
def test_what_to_type_is_told_and_then_nothing_more(tmp_path):
    """The numbers of the words, typed in, bring the words to an end."""
    compiled(EXCITER, tmp_path, "exciter")
    start, held = [words for words in warned(tmp_path, 1.0, 1.05) if "exciter." in words]
    assert "needs " in start
    assert "initial.E = " in start
    field = float(start.split("initial.E = ")[1].split()[0])
    voltage = float(held.split("started for ")[1].split()[0])
    assert "the modes are those of another operating point" in held
    assert not [
        words for words in warned(tmp_path, field, voltage + field / 50) if "exciter." in words
    ]
    (one,) = [words for words in warned(tmp_path, field, 1.05) if "exciter." in words]
    assert one == held
