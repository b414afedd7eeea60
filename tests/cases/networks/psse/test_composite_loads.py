"""Composite loads: their motors, what is left as a load, and a case with one."""

import math

import pytest

from fmus.grid.element_data import Load, Zip
from orchestrator.cases.networks.psse.composite_loads import (
    COMPOSITE_NAMES,
    composite_loads,
    composite_remarks,
)
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.motor_loads import loads_without
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.core.errors import InputError
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_air_conditioners import TYPICAL
from tests.cases.networks.psse.test_motor_loads import RAW, STIFF, case  # noqa: F401 - a fixture
from tests.support.scenarios import prepare_one

FILE_LOADS = [
    FileLoad("load_2", 2, "1", 1, 1, 1, 80.0, 20.0, 80 + 20j),
    FileLoad("load_3", 3, "1", 1, 1, 1, 40.0, 10.0, 40 + 10j),
    FileLoad("load_3", 3, "2", 1, 1, 1, 20.0, 6.0, 20 + 6j),
]
ELEMENTS = [Load("load_2", "bus_2", 80.0, 20.0), Load("load_3", "bus_3", 60.0, 16.0)]
FEEDER = [-1.25, 0, 0.04, 0.04, 0.75, 0.08, 1, 1, 0, 0.9, 1.1, 0.00625, 1.025, 1.04, 30, 5, 0, 0]
ELECTRONIC = [1, 0.7, 0.5, 0.99]
STATIC = [2, 0.4, 1, 0.5, 0.8, 2, -0.5, 1, 1.5, -1]
A = [3, 0.75, 0.04, 1.8, 0.12, 0.104, 0.095, 0.0021, 0.1, 0]
B = [3, 0.75, 0.03, 1.8, 0.19, 0.14, 0.2, 0.0026, 0.5, 2]
C = [3, 0.75, 0.03, 1.8, 0.19, 0.14, 0.2, 0.0026, 0.1, 2]
TRIPS = [0] * 10
D = [float(text) for text in TYPICAL.split()]
EDITIONS = {"U2": ("12 1 2 133 27 146 48 0 0", 133), "U1": ("12 1 0 132 27 146 48", 132)}


def record(shares=(0.2, 0.1, 0.05, 0.3, 0.15), c=C, bus=2, head="USRLOD", edition="U2"):
    """A record as parsers write it: what describes a user's model, then its 133 numbers, or 132."""
    counts, wanted = EDITIONS[edition]
    numbers = [*FEEDER, *shares, *ELECTRONIC, *STATIC]
    assert len(numbers) == 37
    numbers += [*A, *TRIPS, *B, *TRIPS, *c, *TRIPS, *D]
    assert len(numbers) == 132
    numbers += [0] * (wanted - len(numbers))
    what = f"'CMLDBL{edition}' {counts}"
    return f"{bus} '{head}' 1 {what} {' '.join(map(str, numbers))} /\n"


def found(tmp_path, text):
    path = tmp_path / "loads.dyr"
    path.write_text(text)
    return composite_loads(read_dyr(path), FILE_LOADS, ELEMENTS)


def test_the_motors_draw_their_shares_at_their_loading(tmp_path):
    a, b, c = found(tmp_path, record()).motors
    assert [motor.name for motor in (a, b, c)] == ["motor2_a", "motor2_b", "motor2_c"]
    assert [motor.drawn for motor in (a, b, c)] == pytest.approx([16 + 4j, 8 + 2j, 4 + 1j])
    assert a.model == "induction_generator_phasor"
    p = a.parameters
    assert p["S_n"] == pytest.approx(16 / 0.75)
    assert (p["P_0"], p["Q_0"]) == pytest.approx((-0.75, -0.1875))
    wanted = {"RA": 0.04, "X": 1.8, "Xp": 0.12, "Xpp": 0.104, "Tp": 0.095, "Tpp": 0.0021, "H": 0.1}
    assert {name: p[name] for name in wanted} == wanted
    assert b.parameters["E"] == 2
    assert p["Xl"] < p["Xpp"]


def test_what_is_left_is_a_load_with_the_records_law(tmp_path):
    """Of 80 MW 65 % are left: 45 % constant powers, 20 % static; of these 40 % v², 50 % v, 10 % constant."""
    composite = found(tmp_path, record())
    (rest,) = (x for x in loads_without(ELEMENTS, composite.motors) if x.name == "load_2")
    assert (rest.p_mw, rest.q_mvar) == pytest.approx((52.0, 13.0))
    law = composite.laws["load_2"]
    of_p = [0.2 * 0.4 / 0.65, 0.2 * 0.5 / 0.65, (0.2 * 0.1 + 0.45) / 0.65]
    assert (law.active.z, law.active.i, law.active.p) == pytest.approx(of_p)
    assert law.k_pf == pytest.approx((0.8 * 0.2 + 1.0 * 0.3) / 0.65)


@pytest.mark.parametrize("v", [0.9, 1.0, 1.06])
def test_motor_d_draws_what_it_does_while_it_runs(tmp_path, v):
    """Of 20 Mvar 13 are left: 4 static, 6 of motor D at a rating of 24 / 0.8 MVA, 3 constant."""
    law = found(tmp_path, record()).laws["load_2"].reactive
    static = 4 * (-0.5 * v**2 + 1.5 * v)
    own = 24 * math.tan(math.acos(0.97))
    motor = own + 30 * 6 * ((v - 0.86) ** 2 - 0.14**2) + (6 - own) * v**2
    assert 13 * (law.z * v**2 + law.i * v + law.p) == pytest.approx(static + motor + 3)


def test_the_older_edition_is_the_same_load(tmp_path):
    new, old = (found(tmp_path, record(edition=edition)) for edition in EDITIONS)
    assert [motor.parameters for motor in old.motors] == [motor.parameters for motor in new.motors]
    assert (old.laws, old.records[0].name) == (new.laws, "CMLDBLU1")
    assert found(tmp_path, record(edition="U1") + record()).records[0].name == "CMLDBLU2"


def test_a_load_beside_it_at_its_bus_keeps_its_law(tmp_path):
    composite = found(tmp_path, record(bus=3))
    assert [motor.name for motor in composite.motors] == ["motor3_1_a", "motor3_1_b", "motor3_1_c"]
    law, weight = composite.laws["load_3"].active, 26 / 46  # of 40 MW 26 are left, beside 20
    assert law.z == pytest.approx(weight * 0.2 * 0.4 / 0.65 + (1 - weight))


def test_a_motor_a_to_c_of_one_phase_is_a_constant_power(tmp_path):
    composite = found(tmp_path, record(c=[1, *C[1:]]))
    assert [motor.name[-1] for motor in composite.motors] == ["a", "b"]
    assert sum(motor.drawn.real for motor in composite.motors) == pytest.approx(24.0)


def test_a_load_of_motors_alone_leaves_nothing(tmp_path):
    composite = found(tmp_path, record(shares=(0.5, 0.3, 0.2, 0, 0)))
    assert [x.name for x in loads_without(ELEMENTS, composite.motors)] == ["load_3"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (record(shares=(0.5, 0.4, 0.3, 0, 0)), "the shares 0.5, 0.4, 0.3, 0, 0 of motors A to D"),
        (record(shares=(-0.1, 0.4, 0.3, 0, 0)), "each is 0 or more"),
        (record(c=[3, 0, *C[2:]]), "the loading LFm = 0 of motor C; it must exceed 0"),
        ("2 'CMLDBLU2' 1 5 /\n", "has 1 value behind its name; it ends with 133 numbers"),
        (record().replace("0.97", "1.2"), "the power factor 1.2 of a motor of one phase"),
    ],
)
def test_a_record_that_cannot_be_is_refused_by_its_line(tmp_path, text, told):
    with pytest.raises(InputError, match=r"loads\.dyr, line 1: CMLDBLU2") as refused:
        found(tmp_path, text)
    assert told in str(refused.value)


def without_value(text, at):
    """A record without one of its values, counted from its name."""
    begin, *values = text.split("'CMLDBLU1' ")
    values = values[0].split()
    del values[at]
    return f"{begin}'CMLDBLU1' {' '.join(values)}\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (without_value(record(edition="U1"), -2), "131 numbers behind the 7 values"),
        (without_value(record(edition="U1"), 18), "where 132 are declared"),
        (record(edition="U1").replace(" 48 ", " 48 0 "), "has 133 numbers behind the 7 values"),
        (record(edition="U1").replace("U1", "U2"), "declares 132 numbers, as CMLDBLU1 has, and"),
        (record(edition="U1").replace(" 132 ", " 130 "), "declares 130 numbers, and needs 132"),
    ],
)
def test_a_record_whose_numbers_would_shift_is_refused(tmp_path, text, told):
    with pytest.raises(InputError, match=r"loads\.dyr, line 1: CMLDBLU[12]") as refused:
        found(tmp_path, text)
    assert told in str(refused.value)
    assert "correct the record, or write dyr_leave_out = ['CMLDBLU" in str(refused.value)


def test_a_word_among_the_numbers_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"CMLDBLU1 has 'x' as number 103 of its 132"):
        found(tmp_path, record(edition="U1").replace("0.97", "x"))


def test_a_record_without_what_describes_a_users_model_is_the_same(tmp_path):
    bare = record(edition="U1").replace(EDITIONS["U1"][0], "")
    named, alone = (found(tmp_path, text).motors for text in (record(edition="U1"), bare))
    assert [motor.parameters for motor in alone] == [motor.parameters for motor in named]


@pytest.mark.parametrize(
    ("shares", "asks"), [((50, 0, 0, 30, 0), True), ((0.5, 0.4, 0.3, 0, 0), False)]
)
def test_shares_in_percent_are_asked_about(tmp_path, shares, asks):
    with pytest.raises(InputError, match="their sum 1 at most") as refused:
        found(tmp_path, record(shares=shares))
    assert ("are they in percent?" in str(refused.value)) is asks


@pytest.mark.parametrize(("kind", "count"), [(7, 1), (1, 0), (3, 0)])
def test_a_motor_of_a_type_that_there_is_not_is_asked_about(tmp_path, kind, count):
    _, *asked = composite_remarks(found(tmp_path, record(c=[kind, *C[1:]])))
    told = ["has the type 7 of motor C, which draws 0.05 of the load" in x.text for x in asked]
    assert told == [True] * count


def test_a_composite_load_without_motors_says_so(tmp_path):
    (remark,) = composite_remarks(found(tmp_path, record(shares=(0, 0, 0, 0.3, 0))))
    assert "none of motors A to C draws power, motor D" in remark.text


def test_the_approximation_is_told(tmp_path):
    (remark,) = composite_remarks(found(tmp_path, record()))
    assert "3 induction motors A to C for 28 MW (bus_2)" in remark.text
    assert "dyr_leave_out = ['CMLDBLU2'] in [units]" in remark.text
    assert not found(tmp_path, record(bus=9)).records
    assert COMPOSITE_NAMES[0] == "CMLDBLU2"


def test_a_case_takes_it_and_has_a_steady_state_and_modes(case):  # noqa: F811
    prepared = prepare_one(case(record()), "base")
    assert {"motor2_a", "motor2_b", "motor2_c"} <= {*prepared.system.components}
    assert prepared.network is not None
    (load,) = prepared.network.loads
    assert (load.p_mw, load.q_mvar) == pytest.approx((52.0, 22.75))
    assert load.active != Zip(z=1.0)
    (use,) = (use for use in prepared.records if use.kind == "CMLDBLU2")
    assert use.use is UseOfRecord.USED
    result = compute_modes(prepared)
    assert max(value.real for value in result.eigenvalues) < 1e-6
    assert any(abs(value.imag) > 1 for value in result.eigenvalues)


def test_a_case_that_leaves_it_out_has_the_whole_load(case):  # noqa: F811
    change = ('dyr = "mill.dyr"', "dyr_leave_out = ['CMLDBLU2']\ndyr = \"mill.dyr\"")
    prepared = prepare_one(case(record(), change=change), "base")
    assert not any(name.startswith("motor") for name in prepared.system.components)
    assert prepared.network is not None
    assert [load.p_mw for load in prepared.network.loads] == [80.0]
