"""Branches of negative resistance or reactance, as a reduction leaves them: refused by an EMT network, admittances to a
network of phasors, which is then the same as the one that was reduced.
"""

import re

import numpy as np
import pytest

from fmus.grid import phasor_grid
from fmus.grid.network import Line, Network, Port
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from orchestrator.linear.models.linearization import linearize
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.systems.coupling.master import Master
from tests.support.kernels import in_python, taped, vector
from tests.support.written_out import written_out

CASE = """\
name = "pair"
[solver]
stop_time = "0.4 s"
step_size = "5 ms"
[power_flow]
grid = "grid"
slack = "sg"
[network]
lines.tie = {{ from = "b1", to = "b2", X = 0.05, R = 0.005 }}
loads.town = {{ bus = "b2", p = "500 MW", q = "80 Mvar" }}
{network}
[components.sg]
model = "synchronous_generator_st1_phasor"
bus = "b1"
parameters.S_n = "1000 MVA"
[components.vsc]
model = "gfor_phasor"
bus = "b2"
parameters = {{ S_n = "500 MVA", P_0 = 0.6, v_0 = 1.01 }}
[components.grid]
model = "phasor_grid"
"""

# legs from b1, from b2 and to earth at a bus m with a load of 100 MW
ONE, TWO, EARTH = 0.1j, 0.1j, 1.0
WHOLE = {
    "resistance": f"""\
lines.one = {{ from = "b1", to = "m", X = {ONE.imag} }}
lines.two = {{ from = "m", to = "b2", X = {TWO.imag} }}
shunts.middle = {{ bus = "m", g = "{100 / EARTH} MW" }}
""",
    # legs of 0.3, 0.3 and -0.1 pu
    "reactance": """\
three_winding_transformers.star = { buses = ["b1", "b2", "b3"], X_12 = 0.6, X_13 = 0.2, X_23 = 0.2 }
loads.third = { bus = "b3", p = "60 MW", q = "20 Mvar" }
""",
}


def delta(one, two, three):
    """A star's branch between the outer ends of the first two legs."""
    return one + two + one * two / three


def reduced(kind):
    """The same without the star's bus."""
    if kind == "resistance":
        z = delta(ONE, TWO, EARTH)
        text = f'lines.between = {{ from = "b1", to = "b2", X = {z.imag!r}, R = {z.real!r} }}\n'
        for bus, z in (("b1", delta(ONE, EARTH, TWO)), ("b2", delta(TWO, EARTH, ONE))):
            y = 100 / z
            text += f'shunts.at_{bus} = {{ bus = "{bus}", g = "{y.real!r} MW", b = "{y.imag!r} Mvar" }}\n'
        return text
    return (
        f'lines.between = {{ from = "b1", to = "b2", X = {delta(0.3, 0.3, -0.1):.12g} }}\n'
        f'lines.first = {{ from = "b1", to = "b3", X = {delta(0.3, -0.1, 0.3):.12g} }}\n'
        f'lines.second = {{ from = "b2", to = "b3", X = {delta(0.3, -0.1, 0.3):.12g} }}\n'
        f"{WHOLE[kind].splitlines()[1]}"
    )


@pytest.fixture
def prepared(tmp_path):
    def prepare(network, change=lambda text: text):
        (tmp_path / "case.toml").write_text(change(CASE.format(network=network)), encoding="utf-8")
        return load_case(tmp_path / "case.toml").prepare(())[0]

    return prepare


@pytest.mark.parametrize("kind", WHOLE)
def test_a_reduced_network_has_the_voltages_and_modes_of_the_whole_one(prepared, kind):
    def found(network):
        ready = prepared(network)
        with Master(ready.system, ready.schedule, ready.step_size) as master:
            point = find_operating_point(master)
            assert point.initial_residual < 1e-9
            names = [f"{bus}.{part}" for bus in ("b1", "b2") for part in ("v_re", "v_im")]
            at = master.components["grid"].get([*names, "sg.p", "sg.q", "vsc.p", "vsc.q"])
            modes = find_modes(linearize(master), 0.1, 10.0)
            return np.array(list(at.values())), np.array([mode.eigenvalue for mode in modes])

    (values, modes), (wanted_values, wanted_modes) = found(reduced(kind)), found(WHOLE[kind])
    assert values == pytest.approx(wanted_values, abs=1e-9)
    assert len(modes) >= 1
    assert modes == pytest.approx(wanted_modes, rel=1e-6)


@pytest.mark.parametrize("kind", WHOLE)
def test_equivalents_are_named_once(prepared, kind):
    network = reduced(kind)
    value = re.search(rf"{'R' if kind == 'resistance' else 'X'} = (-[\d.]+)", network)
    assert value is not None  # there is something to name
    (question,) = [
        str(q) for q in prepared(network).questions if "branches have a negative" in str(q)
    ]
    lines = network.count("lines.") + 1
    assert (
        f"1 of {lines} branches have a negative {kind}: 'between' ({float(value[1]):g} pu); as equivalents"
        in question
    )
    meant = f'meant = ["grid.{"R" if kind == "resistance" else "X"}_*"]\n'
    assert not [
        q for q in prepared(network, lambda text: meant + text).questions if "branches" in str(q)
    ]


@pytest.mark.parametrize("kind", WHOLE)
def test_an_emt_network_refuses_them_with_the_reason(prepared, kind):
    def as_emt(text):
        return (
            text.replace("phasor_grid", "grid")
            .replace("_phasor", "")
            .replace('step_size = "5 ms"\n', "")
        )

    with pytest.raises(
        CaseError,
        match=rf"line 'between' has the {kind} -\d\.\d+ pu .*would grow in an EMT network",
    ):
        prepared(reduced(kind), as_emt)


def test_a_reactance_of_nothing_is_refused(prepared):
    with pytest.raises(
        CaseError, match=r"line 'none' has the reactance 0 pu .*; its size must be at least 1e-05"
    ):
        prepared('lines.none = { from = "b1", to = "b2", X = 0, R = -0.1 }')


@pytest.mark.parametrize("how", ["code", "data"])
@pytest.mark.parametrize(("beside", "solved"), [(1e-12, False), (0.01, True)])
def test_a_pivot_that_vanishes_gives_no_wrong_voltage(how, beside, solved):
    """Bus m has +jX, −jX and next to nothing else: it is eliminated first, and nearly every digit is lost. With
    pivoting there would be a solution. Without, there is none to be had; never a wrong one.
    """
    lines = (
        Line("am", "a", "m", X=0.1),
        Line("mb", "m", "b", X=-0.1 / (1 + beside)),
        *(Line(f"{x}c", x, "c", X=0.07) for x in "ab"),
        *(Line(f"{x}d", x, "d", X=0.09) for x in "ab"),
        Line("cd", "c", "d", X=0.05),
    )
    network = Network("n", ("m", "a", "b", "c", "d"), lines, (), (Port("g", "a"),), phasors=True)
    model = phasor_grid.phasor_grid(network)
    model = written_out(model, checked=True) if how == "code" else model
    at = model.value_references
    for kernel in (taped(model), in_python(model)):
        z = vector(model)
        z[at["g.e_re"]], z[at["g.y_im"]] = 1.0, -5.0
        kernel.initialise(z)
        kernel.outputs(z)
        values = np.array([z[at[f"{bus}.v"]] for bus in network.buses])
        assert np.isfinite(values).all() == solved
        if solved:
            assert values == pytest.approx(np.ones(5), abs=1e-9)  # nothing draws any current
