"""The variants without network transients: against the EMT ones, against the network's equations, and at their port."""

from contextlib import ExitStack

import numpy as np
import pytest

from fmus.grid.network import Line, Load, Network, Port, Shunt
from fmus.grid.phasor_grid import phasor_grid
from fmus.toolchain.catalogue import build_model
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.support.jacobians import jacobians
from tests.support.kernels import taped, vector

GENERATORS = [f"synchronous_generator_{exciter}" for exciter in ("ac4a", "st1", "st4b")]
DEVICES = ["gfor", "gfl", *GENERATORS]
ALONE = ["regfm_a1"]  # without an EMT variant
OMEGA_B = 2 * np.pi * 50


class Evaluated:
    """A model's functions at one set of parameters, with names."""

    def __init__(self, name, **parameters):
        self.model = build_model(name)
        given = {k.replace("__", "."): v for k, v in parameters.items()}
        assert set(given) <= {v.name for v in self.model.parameters}
        self.p = np.array([given.get(v.name, v.start) for v in self.model.parameters])
        self.c, self.x = (np.array(v).ravel() for v in self.model.initialise(self.p))

    def outputs(self, u, x=None):
        y = self.model.outputs_function(self.x if x is None else x, u, self.p, self.c)
        return dict(zip((o.name for o in self.model.outputs), np.array(y).ravel(), strict=True))

    def rates(self, u):
        return np.array(self.model.derivatives(self.x, u, self.p, self.c)).ravel()

    def response(self, s, u, outputs):
        """Transfer matrix from (v_re, v_im) at s [1/s]."""
        A, B, C, D = (np.array(block) for block in jacobians(self.model)(self.x, u, self.p, self.c))
        rows = [[o.name for o in self.model.outputs].index(name) for name in outputs]
        return (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[rows]


def source(y):
    """Emf and admittance of a device's outputs."""
    return complex(y["e_re"], y["e_im"]), complex(y["y_re"], y["y_im"])


# -- the electrical side ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", [*DEVICES, *ALONE, "gfl_l2ep", "external_grid", "static_generation"]
)
def test_emf_and_admittance_give_the_current(name):
    device = Evaluated(f"{name}_phasor", P_0=0.7, Q_0=0.1, v_0=1.02, theta_0=0.4)
    v = 1.02 * np.exp(0.4j)
    for seen in (v, 0.9 * v):
        y = device.outputs([seen.real, seen.imag])
        e, admittance = source(y)
        assert complex(y["i_re"], y["i_im"]) == pytest.approx((e - seen) * admittance, rel=1e-12)
    start = device.outputs([v.real, v.imag])
    assert (start["p"], start["q"]) == pytest.approx((0.7, 0.1), abs=1e-12)


@pytest.mark.parametrize("name", [*DEVICES, *ALONE])
def test_the_emf_follows_from_states_alone_and_the_current_does_not(name, fmu_path):
    """What a network solver needs, it gets without an algebraic loop; the current would close one."""
    description = read_description(fmu_path(f"{name}_phasor"))
    for output in ("e_re", "e_im", "y_re", "y_im"):
        assert not description.feedthrough(output)
    assert set(description.feedthrough("i_re")) == {"v_re", "v_im"}


@pytest.mark.parametrize("frequency", [0.2, 0.7, 2.0])
@pytest.mark.parametrize("name", DEVICES)
def test_the_port_answers_as_the_emt_variants_does(name, frequency):
    """Within the order of what is left out, (X/ω_b)·di/dt and its like: twice s/ω_b of the answer's size."""
    values, u, s = {"P_0": 0.8, "Q_0": 0.05}, [1.0, 0.0], 2j * np.pi * frequency
    outputs = ("i_re", "i_im")
    found = Evaluated(f"{name}_phasor", **values).response(s, u, outputs)
    wanted = Evaluated(name, **values).response(s, u, outputs)
    error = np.linalg.norm(found - wanted) / np.linalg.norm(wanted)
    assert error < 2 * abs(s) / OMEGA_B


@pytest.mark.parametrize("name", GENERATORS)
def test_subtransient_saliency_is_exact_in_steady_state_and_close_in_motion(name):
    values = {"P_0": 0.8, "Q_0": 0.05, "machine__X_q2": 0.32}  # X''_d is 0.25 or 0.269
    s, u = 2j * np.pi, [1.0, 0.0]
    found, wanted = Evaluated(f"{name}_phasor", **values), Evaluated(name, **values)
    y = found.outputs(u)
    e, admittance = source(y)
    assert (y["p"], y["q"]) == pytest.approx((0.8, 0.05), abs=1e-12)
    assert complex(y["i_re"], y["i_im"]) == pytest.approx((e - 1.0) * admittance, rel=1e-12)
    assert np.abs(found.rates(u)).max() < 1e-9
    answers = [m.response(s, u, ("i_re", "i_im")) for m in (found, wanted)]
    error = np.linalg.norm(answers[0] - answers[1]) / np.linalg.norm(answers[1])
    assert error < 2 * abs(s) / OMEGA_B


def run(path, seconds, step, values, voltage, watched):
    """A device on a bus voltage that changes once, right after the start; the last values of outputs."""
    with ExitStack() as release:
        device = release.enter_context(LoadedComponent("device", read_description(path)))
        device.set(values)
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        device.set(voltage)
        for k in range(round(seconds / step)):
            device.step(k * step, step)
        return device.get(list(watched))


def test_the_converter_comes_to_rest_where_the_emt_variant_does(fmu_path):
    values = {"P_0": 0.6, "Q_0": 0.1, "pod_p.enabled": True, "pod_p.T_W": 0.5}
    changed = {"v_re": 0.97, "v_im": 0.05}
    watched = ("i_re", "i_im", "p", "q", "omega", "u", "i_s")
    found = run(fmu_path("gfor_phasor"), 20.0, 5e-3, values, changed, watched)
    wanted = run(fmu_path("gfor"), 20.0, 1e-3, values, changed, watched)
    # The PI of the EMT variant's voltage control has a time constant of k_p/k_i = 1.25 s: e^−16 is left.
    assert found == pytest.approx(wanted, rel=1e-6)
    assert found["q"] != pytest.approx(0.1, abs=0.05)


def test_the_current_limit_is_not_represented_and_the_model_says_when_it_would_act(fmu_path):
    watched = ("current_limit", "i_s")
    normal = run(
        fmu_path("gfor_phasor"), 1.0, 5e-3, {"P_0": 0.9}, {"v_re": 1.0, "v_im": 0.0}, watched
    )
    dip = run(
        fmu_path("gfor_phasor"), 0.05, 5e-3, {"P_0": 0.9}, {"v_re": 0.6, "v_im": 0.0}, watched
    )
    limited = run(fmu_path("gfor"), 0.05, 1e-4, {"P_0": 0.9}, {"v_re": 0.6, "v_im": 0.0}, ("i_s",))
    assert normal["current_limit"] == pytest.approx(0.9 / 1.1, abs=0.02)
    assert dip["current_limit"] > 1.5
    assert dip["i_s"] > 1.3 * limited["i_s"]


@pytest.mark.parametrize(("P", "Q"), [(0.9, 0.0), (0.2, 0.6), (0.2, -0.5)])
def test_the_current_limit_of_each_axis_is_its_own(P, Q):
    """At the operating point, from the current that the power flow asks of the converter, in the capacitor's frame."""
    device = Evaluated(
        "gfor_phasor", P_0=P, Q_0=Q, voltage_control__i_q_max=1.3, voltage_control__i_d_max=0.8
    )
    values = dict(zip((v.name for v in device.model.parameters), device.p.tolist(), strict=True))
    i_g = complex(P, -Q)
    u = 1.0 + complex(values["transformer.R_t"], values["transformer.X_t"]) * i_g
    B_c = values["filter.B_c"]
    # in series with the capacitor: 1/(30·B_c)
    i_s = (i_g + 1j * B_c * u / (1 + 1j / 30)) * np.exp(-1j * np.angle(u))
    wanted = max(abs(i_s.real) / 1.3, abs(i_s.imag) / 0.8)
    assert device.outputs([1.0, 0.0])["current_limit"] == pytest.approx(wanted, rel=1e-9)


def test_a_dispatch_beyond_the_current_limit_is_refused(fmu_path):
    with LoadedComponent("device", read_description(fmu_path("gfor_phasor"))) as device:
        device.set({"P_0": 1.3})
        device.setup(0.0, None)
        device.enter_initialization_mode()
        with pytest.raises(
            ComponentError, match=r"voltage_control\.i_q_max: lower P_0 or raise S_n"
        ):
            device.exit_initialization_mode()


@pytest.mark.parametrize("name", [*DEVICES, *ALONE])
def test_behind_an_open_breaker_there_is_no_admittance_and_no_current(name):
    device = Evaluated(f"{name}_phasor", P_0=0.5, connected=0.0)
    y = device.outputs([1.0, 0.0])
    assert [y[k] for k in ("i_re", "i_im", "p", "q", "y_re", "y_im")] == pytest.approx(
        [0.0] * 6, abs=1e-15
    )
    if "v_t" in y:
        assert y["v_t"] == pytest.approx(abs(source(y)[0]), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "time"), [("gfor", 0.05), ("regfm_a1", 0.02), *((name, 0.1) for name in GENERATORS)]
)
def test_the_emf_is_given_for_the_middle_of_the_coming_step(name, time):
    """Against the emf itself, followed with small steps on the same held voltage, at a time when it is on its way."""
    step, values = 5e-3, {"P_0": 0.8, "Q_0": 0.05}
    v = [0.98, -0.02]

    def emf_after(seconds, ahead):
        device = Evaluated(f"{name}_phasor", communication_step=ahead, **values)
        x, h = device.x, 1e-4
        for _ in range(round(seconds / h)):
            k1 = np.array(device.model.derivatives(x, v, device.p, device.c)).ravel()
            k2 = np.array(device.model.derivatives(x + h / 2 * k1, v, device.p, device.c)).ravel()
            x = x + h * k2
        return source(device.outputs(v, x))[0]

    moving = [emf_after(time + t, 0.0) for t in (0.0, step / 2)]
    predicted = emf_after(time, step)
    moved = abs(moving[1] - moving[0])
    assert moved > 1e-5
    assert abs(predicted - moving[1]) < 0.05 * moved


@pytest.mark.parametrize(
    "name", ["gfor", "gfl", "gfl_l2ep", "regfm_a1", "static_generation", GENERATORS[0]]
)
def test_the_current_is_that_of_the_middle_of_the_last_step(name):
    """An emf that is asked for one step early is that of the last step."""
    device = Evaluated(f"{name}_phasor", communication_step=5e-3, P_0=0.7, Q_0=0.1)
    x, v = device.x + 1e-3 * np.arange(1, len(device.x) + 1), 0.97 - 0.02j
    seen = device.outputs([v.real, v.imag], x)
    early = [p.name for p in device.model.parameters].index("steps_late")
    device.p[early] = -1
    e, y = source(device.outputs([v.real, v.imag], x))
    assert complex(seen["i_re"], seen["i_im"]) == pytest.approx((e - v) * y, rel=1e-10)
    assert abs(e - source(seen)[0]) > 1e-4  # it moves


# -- the network --------------------------------------------------------------------------------

NETWORK = Network(
    "small_phasor_grid",
    ("a", "b", "c", "d"),
    (
        Line("ab", "a", "b", X=0.05, R=0.004, B=0.3),
        Line("bc", "b", "c", X=0.08, R=0.01, tap=1.05, shift=0.1),
        Line("ca", "c", "a", X=0.12, B=0.1, tap=0.97),
        Line("cd", "c", "d", X=0.02, R=0.001),
    ),
    (Load("city", "b", 80.0, 30.0), Load("plant", "c", 50.0, -10.0), Load("village", "d", 5.0)),
    (Port("one", "a"), Port("two", "c")),
    (Shunt("coil", "b", b_mvar=-20.0), Shunt("bank", "d", g_mw=1.0, b_mvar=15.0)),
)
VALUES = {"b.v_0": 0.97, "b.theta_0": -0.1, "c.v_0": 1.03, "d.v_0": 1.01, "city.scale": 1.2}
SOURCES = {"one": (1.05 + 0.1j, 2.0 - 30.0j), "two": (0.98 - 0.2j, 1.0 - 12.0j)}


def admittances(scale, ca_closed=True):
    """The nodal matrix from the elements' textbook formulas, and the sources' currents."""
    Y, current = np.zeros((4, 4), complex), np.zeros(4, complex)
    at = {"a": 0, "b": 1, "c": 2, "d": 3}
    for line in NETWORK.lines:
        f, t = at[line.from_bus], at[line.to_bus]
        charging = line.B
        y = 1 / complex(line.R, line.X)
        if line.name == "ca" and not ca_closed:
            y, charging = 0.0, 1e-3 * charging  # what stays of an open line's charging
        ratio = line.tap * np.exp(1j * line.shift)
        Y[f, f] += (y + 0.5j * charging) / abs(ratio) ** 2
        Y[t, t] += y + 0.5j * charging
        Y[f, t] -= y / ratio.conjugate()
        Y[t, f] -= y / ratio
    drawn = (
        ("city", "b", 0.8 + 0.3j, 0.97),
        ("plant", "c", 0.5 - 0.1j, 1.03),
        ("village", "d", 0.05, 1.01),
    )
    for name, bus, s, v_0 in drawn:
        Y[at[bus], at[bus]] += np.conj(s) / v_0**2 * (scale if name == "city" else 1.0)
    Y[1, 1] += -0.2j
    Y[3, 3] += 0.01 + 0.15j
    for name, bus in (("one", "a"), ("two", "c")):
        e, y = SOURCES[name]
        Y[at[bus], at[bus]] += y
        current[at[bus]] += y * e
    return Y, current


@pytest.mark.parametrize("closed", [True, False])
def test_the_network_solves_its_nodal_equations(closed):
    model = phasor_grid(NETWORK)
    assert len(model.states) == 0
    given = {}
    for name, pair in SOURCES.items():
        for letter, value in zip("ey", pair, strict=True):
            given |= {f"{name}.{letter}_re": value.real, f"{name}.{letter}_im": value.imag}
    z, kernel = vector(model, **VALUES, **{"ca.connected": float(closed)}, **given), taped(model)
    kernel.initialise(z)
    kernel.outputs(z)
    y = dict(zip(model.value_references, z, strict=True))
    found = np.array([complex(y[f"{bus}.v_re"], y[f"{bus}.v_im"]) for bus in "abcd"])
    Y, current = admittances(1.2, closed)
    assert found == pytest.approx(np.linalg.solve(Y, current), rel=1e-12)
    e, admittance = SOURCES["two"]
    assert complex(y["two.p"], y["two.q"]) == pytest.approx(
        found[2] * np.conj((e - found[2]) * admittance), rel=1e-12
    )
    if not closed:
        assert (y["ca.p"], y["ca.q"]) == (0.0, 0.0)
    else:
        drawn = (found[2] / 0.97 - found[0]) / 0.12j / 0.97
        assert complex(y["ca.p"], y["ca.q"]) == pytest.approx(
            found[2] * drawn.conjugate(), rel=1e-12
        )


def test_a_load_of_any_bus_may_be_switched_off(fmu_path):
    """The devices' admittances hold the voltage where in the EMT network a load has to."""
    assert (
        read_description(fmu_path("two_area_phasor_grid")).variables["load_2.scale"].minimum == 0.0
    )
    assert read_description(fmu_path("two_area_grid")).variables["load_2.scale"].minimum > 0.0
