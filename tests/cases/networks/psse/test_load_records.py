"""Records of loads in dynamics data: which load each is of, its law, and the modes of a case with them."""

import numpy as np
import pytest

from fmus.grid.element_data import Load, Zip
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.load_records import (
    RecordedLaw,
    recorded_laws,
    with_recorded_laws,
)
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_machine_bases import dynamics, network
from tests.support.scenarios import prepare_one

POWERS = "2 1 0 2 1 0"  # exponents n1 to n6 of impedance, current and power
LOADS = [
    FileLoad("load_1", 1, "1", 10, 5, 7, 80.0, 20.0),
    FileLoad("load_2", 2, "1", 20, 5, 7, 60.0, 10.0),
    FileLoad("load_3", 3, "1", 20, 6, 8, 30.0, 0.0),
    FileLoad("load_3", 3, "2", 20, 6, 8, 10.0, 0.0),
]
IMPEDANCE, CURRENT, POWER = "1 0 0 1 0 0", "0 1 0 0 1 0", "0 0 1 0 0 1"


def laws(tmp_path, *records):
    (tmp_path / "loads.dyr").write_text("".join(f"{text} /\n" for text in records))
    return recorded_laws(read_dyr(tmp_path / "loads.dyr"), LOADS)


def record(kind, number, identifier, shares, k="0 0"):
    return f"{number} '{kind}' {identifier} {shares} {k} {POWERS}"


def test_the_narrower_record_goes_first(tmp_path):
    found = laws(
        tmp_path,
        record("IEELAL", 0, "*", IMPEDANCE),
        record("IEELAR", 20, "*", CURRENT),
        record("IEELZN", 6, "*", POWER),
        record("IEELBL", 2, "1", POWER, "1.5 -1"),
    )
    assert found.laws["load_1"].active == Zip(z=1.0)
    assert found.laws["load_2"].active == Zip(p=1.0)
    assert (found.laws["load_2"].k_pf, found.laws["load_2"].k_qf) == (1.5, -1.0)
    assert found.laws["load_3"].active == Zip(p=1.0)
    assert {line for _, line in found.places} == {1, 3, 4}


def test_loads_of_one_bus_are_the_mean_of_their_laws(tmp_path):
    found = laws(
        tmp_path, record("IEELBL", 3, "1", IMPEDANCE), record("IEELBL", 3, "2", POWER, "2 0")
    )
    assert set(found.laws) == {"load_3"}
    law = found.laws["load_3"]
    assert (law.active.z, law.active.p, law.k_pf) == pytest.approx((0.75, 0.25, 0.5))


def test_a_load_without_a_record_keeps_the_cases_law(tmp_path):
    found = laws(tmp_path, record("IEELOW", 8, "*", CURRENT))
    assert set(found.laws) == {"load_3"}


def test_any_exponent_has_its_power_slope_and_curvature(tmp_path):
    found = laws(tmp_path, "0 'IEELAL' * 0.3 0.5 0 1 0 0 0 0 0.7 1.6 0 -0.4 0 0")
    law = found.laws["load_1"].active
    v = np.array([0.9, 0.99, 1.0, 1.01, 1.1])
    wanted = (0.3 * v**0.7 + 0.5 * v**1.6) / 0.8
    ours = law.z * v**2 + law.i * v + law.p
    assert ours[1:4] == pytest.approx(wanted[1:4], abs=1e-7)
    assert ours == pytest.approx(wanted, abs=1e-4)
    (remark,) = found.remarks
    assert "shares of P sum to 0.8; they are scaled to 1" in str(remark)


@pytest.mark.parametrize(
    "values", ["1 0 0 1", "0 0 0 1 0 0 0 0 2 0 0 2 0 0", "x 0 0 1 0 0 0 0 2 0 0 2 0 0"]
)
def test_a_record_that_is_no_law_is_not_applied(tmp_path, values):
    assert not laws(tmp_path, f"0 'IEELAL' * {values}").laws


def test_a_load_takes_the_law():
    law = RecordedLaw(("x.dyr", 1), Zip(i=1.0), Zip(z=1.0), 1.0, 0.0)
    found = with_recorded_laws(Load("load_1", "bus_1", 80.0, 20.0), law)
    assert (found.active, found.reactive, found.k_pf) == (law.active, law.reactive, law.k_pf)
    assert (found.p_mw, found.bus) == (80.0, "bus_1")


@pytest.mark.parametrize(
    "said", ["", 'load_model = { active = "impedance", reactive = "impedance" }']
)
def test_a_case_takes_the_laws_where_it_says_no_others(said, tmp_path):
    """The record's constant power, its modes as with the case's own; the case's word goes before it."""
    power = 'load_model = { active = "power", reactive = "power", k_pf = 1.5 }'
    recorded = swings(tmp_path, "0 'IEELAL' * 0 0 1 0 0 1 1.5 0 2 1 0 2 1 0 /\n", said)
    wanted = swings(tmp_path, "", said or power)
    assert recorded[0] == pytest.approx(wanted[0], rel=1e-6)
    assert recorded[1] == (not said)


def swings(tmp_path, record, said):
    """Oscillations [1/s], and whether the question about the load model is not asked."""
    (tmp_path / "grid.raw").write_text(network())
    records = dynamics(1, 6.5, 900.0, 900.0) + dynamics(3, 6.5, 900.0, 900.0) + record
    (tmp_path / "grid.dyr").write_text(records)
    out = tmp_path / "case.toml"
    files = (tmp_path / "grid.raw", tmp_path / "grid.dyr")
    text = write_case(WantedCase(files, out)).text
    out.write_text(text.replace("[network]\n", f"[network]\n{said}\n"), encoding="utf-8")
    prepared = prepare_one(out, "base")
    found = (mode.eigenvalue for mode in compute_modes(prepared).modes)
    asked = any("load model is open" in question.text for question in prepared.questions)
    used = any(use.kind == "IEELAL" and use.use is UseOfRecord.USED for use in prepared.records)
    assert used == (bool(record) and not said)
    return sorted((x for x in found if x.imag > 0.1), key=lambda x: x.imag), not asked and used
