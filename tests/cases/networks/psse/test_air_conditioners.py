"""Air conditioners of one phase: the law of ACMTBLU1 beside its equations, and a case with one."""

import math

import pytest

from fmus.grid.element_data import Load, Zip
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.load_records import recorded_laws
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.core.errors import InputError
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_motor_loads import RAW, case  # noqa: F401 - a fixture
from tests.support.scenarios import prepare_one

TYPICAL = (
    "0.033 0.4 0.02 0.05 0.8 0.97 0.6 0.124 0.114 0 0 1 6 2 12 3.2 11 2.5 0.86 0 0.9 1 -3.3 0.45 0.35 0.5 0.4 10 "
    "1.3 4.3 0 0.8 0.2 0.9 5"
)
"""WECC's typical values, of GridPACK's file 3g9b_gensal_esst1a_wsieg1_1acmotor_bus5smallload.dyr."""

CURVED = (
    "0.033 0.4 0.02 0.05 0.7 0.9 0.6 0.124 0.114 0.1 1.5 2.2 6 2.7 12 3.2 11 2.5 0.86 0 0.9 1.3 -3.3 0.45 0.35 0.5 "
    "0.4 10 1.3 4.3 0 0.8 0.2 0.9 5"
)
"""The same with other exponents, a gain of P, and a breakdown voltage that depends on the loading."""


def laws(tmp_path, record, v_pu=1.0, loads=None):
    path = tmp_path / "loads.dyr"
    path.write_text(record)
    own = loads or [FileLoad("load_5", 5, "1", 1, 1, 1, 40.0, 20.0, 40 + 20j, v_pu)]
    return recorded_laws(read_dyr(path), own)


def drawn(numbers, p_mw, q_mvar, v_0, v):
    """P and Q at a voltage by the equations that GridPACK has, with the susceptance that Q differs by."""
    p = [float(text) for text in numbers.split()]
    loading, factor, shift = p[4], p[5], p[9]
    k_p1, n_p1, k_q1, n_q1, k_p2, n_p2, k_q2, n_q2, v_break = p[10:19]
    v_break *= 1 + shift * (loading - 1)
    rating = p_mw / loading

    def curve(k_1, n_1, k_2, n_2, at):
        return k_1 * (at - v_break) ** n_1 if at >= v_break else k_2 * (v_break - at) ** n_2

    active, reactive = (k_p1, n_p1, k_p2, n_p2), (k_q1, n_q1, k_q2, n_q2)
    own = p_mw * math.tan(math.acos(factor))
    moved_p = rating * (curve(*active, v) - curve(*active, v_0))
    moved_q = rating * (curve(*reactive, v) - curve(*reactive, v_0))
    return p_mw + moved_p, own + moved_q + (q_mvar - own) * (v / v_0) ** 2


def of_law(law, v):
    return law.z * v**2 + law.i * v + law.p


@pytest.mark.parametrize("numbers", [TYPICAL, CURVED])
@pytest.mark.parametrize("v_0", [1.02, 0.75])
def test_the_law_touches_the_equations_at_the_files_voltage(tmp_path, numbers, v_0):
    """Value, slope and curvature, by differences of the equations above and below the breakdown voltage."""
    (law,) = laws(tmp_path, f"5 'ACMTBLU1' 1 {numbers} /", v_0).laws.values()
    h = 1e-3
    for at, own, power in ((0, law.active, 40.0), (1, law.reactive, 20.0)):
        wanted = [drawn(numbers, 40.0, 20.0, v_0, v_0 * (1 + k * h))[at] for k in (-1, 0, 1)]
        got = [power * of_law(own, 1 + k * h) for k in (-1, 0, 1)]
        assert got[1] == pytest.approx(power)
        assert got[2] - got[0] == pytest.approx(wanted[2] - wanted[0], rel=1e-4, abs=1e-9)
        curved = [x[2] - 2 * x[1] + x[0] for x in (got, wanted)]
        assert curved[0] == pytest.approx(curved[1], rel=1e-2, abs=1e-9)


def test_typical_values_are_met_exactly_above_breakdown(tmp_path):
    """The exponents 1 and 2 are those of the mixture, so that it holds far from the operating point too."""
    (law,) = laws(tmp_path, f"5 'ACMTBLU1' 1 {TYPICAL} /").laws.values()
    p_mw, q_mvar = drawn(TYPICAL, 40.0, 20.0, 1.0, 0.88)
    assert (40 * of_law(law.active, 0.88), 20 * of_law(law.reactive, 0.88)) == pytest.approx(
        (p_mw, q_mvar)
    )


def test_the_frequency_acts_on_what_the_motors_draw(tmp_path):
    (law,) = laws(tmp_path, f"5 'ACMTBLU1' 1 {TYPICAL} /").laws.values()
    own = 40 * math.tan(math.acos(0.97)) / 20
    assert (law.k_pf, law.k_qf) == pytest.approx((1.0, -3.3 * own))


def test_a_users_model_and_records_of_areas_are_read(tmp_path):
    plain = laws(tmp_path, f"5 'ACMTBLU1' 1 {TYPICAL} /")
    written = f"5 'USRLOD' 1 'ACMTBLU1' 12 1 0 35 9 29 16 {TYPICAL} /"
    assert laws(tmp_path, written).laws == plain.laws
    assert laws(tmp_path, f"1 'ACMTARU1' * {TYPICAL} /").laws == plain.laws
    assert not laws(tmp_path, f"6 'ACMTBLU1' 1 {TYPICAL} /").laws


def test_a_load_without_reactive_power_keeps_none(tmp_path):
    alone = [FileLoad("load_5", 5, "1", 1, 1, 1, 40.0, 0.0, 40 + 0j)]
    (law,) = laws(tmp_path, f"5 'ACMTBLU1' 1 {TYPICAL} /", loads=alone).laws.values()
    assert (law.reactive, law.k_qf) == (Zip(p=1.0), 0.0)


def test_the_approximation_is_told_once(tmp_path):
    (remark,) = laws(tmp_path, f"5 'ACMTBLU1' 1 {TYPICAL} /").remarks
    assert "ACMTBLU1, air conditioners of one phase (1 record: 5), is approximated" in remark.text
    assert "stalling, restarting" in remark.text
    assert "dyr_leave_out = ['ACMTBLU1'] in [units]" in remark.text


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ("1 2 3", "has 3 values, and needs 35 (TSTALL to TTR2), or 7 before these"),
        (TYPICAL + " 0.43", "has 36 values, and needs 35"),
        (TYPICAL.replace("0.97", "0"), "the power factor 0 of a motor of one phase"),
        (TYPICAL.replace("0.97", "x"), "has COMPPF = 'x'; it must be a number"),
        (TYPICAL.replace(" 0.8 0.97", " -0.8 0.97"), "the loading -0.8"),
    ],
)
def test_a_record_that_cannot_be_is_refused_by_its_line(tmp_path, values, told):
    with pytest.raises(InputError, match=r"loads\.dyr, line 1: ACMTBLU1") as refused:
        laws(tmp_path, f"5 'ACMTBLU1' 1 {values} /")
    assert told in str(refused.value)


def test_a_case_takes_it(case):  # noqa: F811
    prepared = prepare_one(case(f"2 'ACMTBLU1' 1 {TYPICAL} /\n"), "base")
    assert prepared.network is not None
    (load,) = prepared.network.loads
    assert isinstance(load, Load)
    assert load.k_pf == 1.0
    assert load.reactive.z > 1
    (use,) = (use for use in prepared.records if use.kind == "ACMTBLU1")
    assert use.use is UseOfRecord.USED
    result = compute_modes(prepared)
    assert max(value.real for value in result.eigenvalues) < 1e-6
