"""A controller with a circuit around it: its start, its modes over the period, and mistakes in its file."""

import cmath

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.core.errors import AnalysisError, ComponentError, InputError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.linearization import compose
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.sampled import steps_of_period
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one
from tests.support.vendor_dlls import compiled, droop_device, lag

W_B = 2 * np.pi * 50
R, X, P_0, Q_0 = 0.015, 0.25, 0.7, 0.1


def device_master(file, step=1e-4, **values):
    """The device at a bus whose voltage stands."""
    system = System()
    system.add("ibr", read_description(file))
    plan = system.components["ibr"]
    plan.parameters.update({"P_0": P_0, "Q_0": Q_0, "v_0": 1.0, **values})
    plan.inputs.update({"v_re": 1.0, "v_im": 0.0})
    return Master(system, gauss_seidel([["ibr"]]), step)


LAG = W_B * 1e-4 / 2
"""Angle by which a voltage that is held for a sample of 100 µs lags the one that was computed [rad]."""


def averaged(mp=0.02, tau=0.05):
    """Eigenvalues of the same device without samples: equations by hand, linearised by differences."""
    i_0 = complex(P_0, -Q_0)
    e_0 = (1 + (R + 1j * X) * i_0) * cmath.exp(1j * LAG)
    p_ref = (e_0 * i_0.conjugate()).real

    def rates(x):
        i, filtered, theta = complex(x[0], x[1]), x[2], x[3]
        e = abs(e_0) * cmath.exp(1j * theta)
        di = W_B / X * (e * cmath.exp(-1j * LAG) - 1 - (R + 1j * X) * i)
        dp = ((e * i.conjugate()).real - filtered) / tau
        return np.array([di.real, di.imag, dp, W_B * mp * (p_ref - filtered)])

    x = np.array([i_0.real, i_0.imag, p_ref, cmath.phase(e_0)])
    assert np.abs(rates(x)).max() < 1e-10
    J = np.column_stack([(rates(x + d) - rates(x - d)) / 2e-6 for d in 1e-6 * np.eye(4)])
    return np.linalg.eigvals(J)


def swing(values):
    """The oscillation that the droop makes, not that of the inductor at the network's frequency."""
    return next(v for v in values if 1 < v.imag < 200)


@pytest.mark.slow
def test_the_start_delivers_the_power_flows_power(tmp_path):
    with device_master(droop_device(tmp_path)) as master:
        found = master.components["ibr"].values(["p", "q", "u", "controller.p"])
        e = 1 + (R + 1j * X) * complex(P_0, -Q_0)
        # at an instant; the held voltage makes a ripple
        assert found["p"] == pytest.approx(P_0, abs=2e-4)
        assert found["q"] == pytest.approx(Q_0, abs=1e-3)
        seen = e * cmath.exp(1j * LAG) * complex(P_0, Q_0)
        # a staircase has harmonics: LAG²/6
        assert found["controller.p"] == pytest.approx(seen.real, abs=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("wrap", ["*theta = fmod(*theta, turn);", ""])
def test_modes_over_the_period_are_those_of_the_averaged_device(tmp_path, wrap):
    """An angle that grows, and a clock, are seen to count."""
    with device_master(droop_device(tmp_path, wrap=wrap)) as master:
        point = find_operating_point(master)
        assert point.residual < 1e-9
        blocks = Blocks(master)
        assert blocks.period == 200
        found, expected = swing(eigenvalues(model_of(master, blocks))), swing(averaged())
        assert abs(found.imag - expected.imag) / (2 * np.pi) < 0.005
        assert abs(found.real / abs(found) - expected.real / abs(expected)) < 0.005


@pytest.mark.slow
def test_the_inductors_mode_is_told_at_the_networks_frequency(tmp_path):
    """Over a period of 20 ms a mode at 50 Hz looks like one at 0 Hz; its motion in the period tells."""
    with device_master(droop_device(tmp_path)) as master:
        find_operating_point(master)
        values = eigenvalues(model_of(master, Blocks(master)))
        expected = max(averaged(), key=lambda v: v.imag)
        assert expected.imag > 300
        nearest = min(values, key=lambda v: abs(v - expected))
        assert nearest.imag == pytest.approx(expected.imag, abs=0.03 * 2 * np.pi)
        assert nearest.real == pytest.approx(expected.real, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("sample", "delay"), [(1e-3, 0), (1e-3, 1), (4e-4, 1)])
def test_modes_of_slow_samples_are_those_of_the_ring_down(tmp_path, sample, delay):
    with device_master(droop_device(tmp_path, sample=sample, delay=delay)) as master:
        find_operating_point(master)
        found = swing(eigenvalues(model_of(master, Blocks(master))))
        component = master.components["ibr"]
        rest = []
        saved = component.save_state()
        for _ in range(40):
            master.advance(200)
            rest.append(component.values(["controller.p"])["controller.p"])
        component.restore_state(saved)
        component.set({"controller.DoubleStates[2]": rest[0] + 1e-3})
        swung = []
        for _ in range(40):
            master.advance(200)
            swung.append(component.values(["controller.p"])["controller.p"])
        y = (np.array(swung) - np.array(rest))[3:]
        # Two oscillations: y[k+4] is a sum of the four values before. The other one is the inductor's.
        rows = np.column_stack([y[k : len(y) - 4 + k] for k in (3, 2, 1, 0)])
        factors = np.linalg.lstsq(rows, y[4:], rcond=None)[0]
        seen = np.log(np.roots([1, *-factors]).astype(complex)) / 0.02
        shown = min(seen, key=lambda v: abs(v - found))
        assert abs(found.imag - shown.imag) / (2 * np.pi) < 0.005
        assert abs(found.real / abs(found) - shown.real / abs(shown)) < 0.005


@pytest.mark.slow
def test_the_map_of_one_step_is_refused(tmp_path):
    with device_master(droop_device(tmp_path)) as master:
        blocks = Blocks(master)
        with pytest.raises(
            AnalysisError, match=r"repeat only after 200 communication steps of 0\.0001 s"
        ):
            compose(blocks, master.schedule)


def test_samples_that_never_meet_the_step_are_refused(tmp_path):
    system = System()
    system.add("lag", read_description(compiled(lag(sample_time=1.0007e-4), tmp_path)))
    system.components["lag"].inputs["u"] = 1.0
    with (
        Master(system, gauss_seidel([["lag"]]), 1e-4) as master,
        pytest.raises(
            AnalysisError, match=r"repeat together after .* take a step that divides these times"
        ),
    ):
        steps_of_period(master, 1e-4)


def test_a_dll_that_is_read_cannot_write_beside_its_own_folder(tmp_path):
    mark = tmp_path / "mark"
    head = "#include <stdio.h>\n"
    begin = f'FILE *f = fopen("{mark}", "w"); if (f) fclose(f);'
    as_fmu(compiled(lag(head=head, begin=begin), tmp_path))
    assert not mark.exists()


def test_a_dll_stands_in_a_case_and_only_instead_of_an_fmu(tmp_path):
    compiled(lag(), tmp_path, "vendor")
    text = """
name = "one"
[solver]
groups = [["k"]]
[components.k]
dll = "vendor.so"
inputs = { u = 0.5 }
"""
    case = tmp_path / "case.toml"
    case.write_text(text, encoding="utf-8")
    prepared = prepare_one(str(case))
    assert prepared.system.components["k"].description.states == ("held.y", "DoubleStates[1]")
    case.write_text(text.replace("dll =", 'fmu = "k.fmu"\ndll ='), encoding="utf-8")
    with pytest.raises(InputError, match=r"give either 'model' .*, 'fmu' .*, 'dll' .* or 'scan'"):
        load_case(str(case)).prepare()


@pytest.mark.slow
def test_a_vendors_code_is_not_taken_for_ours(tmp_path):
    """It runs in a process of its own, though its FMU was built and kept here."""
    assert not is_ours(as_fmu(droop_device(tmp_path)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('["e[1]", "e[2]", "e[3]"]', '["e[1]", "e[3]", "e[2]"]'),
        ('"i[1]" = "i_s_a"', '"i[1]" = { from = "i_s_a", sign = -1 }'),
        ('voltage = ["e[1]"', 'unit = "V"\nvoltage = ["e[1]"'),
    ],
    ids=["phases turned", "one current turned", "a unit of a thousandth"],
)
def test_a_wrong_binding_finds_no_start(tmp_path, old, new):
    """What would be another device in silence does not come to deliver the power."""
    file = droop_device(tmp_path, changes=[(old, new), ("[unit]", "[start]\nlongest = 2\n[unit]")])
    with pytest.raises(ComponentError, match=r"at the power flow's voltage it delivers P = "):
        device_master(file)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"i[1]" = "i_s_a"', '"i[4]" = "i_s_a"', r"\[inputs\] i\[4\]: the DLL has no such input"),
        ('"i_s_a"', '"i_x_a"', r"the circuit has no quantity 'i_x_a'"),
        (
            'p_ref = "P_ref"',
            'p_ref = { from = "P_ref", unit = "MHz" }',
            r"the unit 'MHz' is none of a power",
        ),
        (
            'v_ref = "V_ref"',
            'v_ref = { from = "V_ref", unit = "kV" }',
            r"V_ref is given in pu alone",
        ),
        ('filter = "L"', 'filter = "CL"', r"filter = 'CL'; it must be one of: L, LC, LCL"),
        ('"e[3]"]', '"e[2]"]', r"three different outputs of the DLL are needed"),
        ("S_n = 2.0\nV_n", "V_n", r"\[unit\] needs S_n \[MVA\] and V_n \[kV\]"),
        (
            "filter.X = 0.15",
            "filter.X = 0.0",
            r"\[circuit\] filter\.X = 0\.0; allowed is 0\.001 to None",
        ),
        ("delay = 0", "delay = 2", r"delay = 2; it must be 0 or 1"),
        ("[inputs]", "[start]\ntrims = ['Q']\n[inputs]", r"Q_ref goes to no input of the DLL"),
        ('"droop.so"', '"none.so"', r"none\.so: cannot be read"),
    ],
)
def test_a_mistake_in_a_devices_file_is_one_clear_error(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words):
        as_fmu(droop_device(tmp_path, changes=[(old, new)]))


@pytest.mark.slow
def test_a_control_for_another_frequency_is_named_as_the_cause(tmp_path):
    """A droop for 60 Hz in a circuit for 50 Hz, with which it starts once it is told."""
    file = droop_device(tmp_path, changes=[("[inputs]", "[parameters]\nf = 60\n[inputs]")])
    words = r"in a network of 60 Hz it starts, and here f_n = 50 Hz: its control is made for 60 Hz.* give f_n = 60 in"
    with pytest.raises(ComponentError, match=words):
        device_master(file)
    found = gfor.check(file, only=["initial_outputs", "steady_state"], frequency=60)
    assert found.trusted, found.table()


@pytest.mark.slow
def test_no_frequency_is_blamed_where_phases_are_exchanged(tmp_path):
    changes = [('"i[2]" = "i_s_b"', '"i[2]" = "i_s_c"'), ('"i[3]" = "i_s_c"', '"i[3]" = "i_s_b"')]
    with pytest.raises(ComponentError, match=r"it delivers P = .* check \[inputs\]") as caught:
        device_master(droop_device(tmp_path, changes=changes))
    assert "Hz" not in str(caught.value)


def test_a_frequency_is_given_to_what_has_one(tmp_path):
    with pytest.raises(
        InputError,
        match=r"frequency = 60: controller.so has no parameter f_n; a binding's \[rating\]",
    ):
        gfor.check(compiled(lag(), tmp_path), frequency=60)
