"""Bases and units of a binding, against numbers worked out on paper: 1500 MVA, 230 kV, 60 Hz."""

import pytest

from orchestrator.devices.binding.binding import _Reader
from orchestrator.devices.binding.scales import Bases, angle_unit_of, unit_of
from orchestrator.devices.fmi.description import VariableInfo

BASES = Bases(1500.0, 230.0, 60.0)


@pytest.mark.parametrize(
    ("unit", "value", "number"),
    [
        ("kV", "line-to-line rms", 230.0),
        ("kV", "line-to-line peak", 325.269),  # 230·√2
        ("kV", "phase rms", 132.791),  # 230/√3
        ("kV", "phase peak", 187.794),  # 230·√(2/3)
        ("V", "phase rms", 132790.6),
        ("MV", "phase peak", 0.187794),
    ],
)
def test_a_voltage_in_volts(unit, value, number):
    assert BASES.voltage_unit(unit, None, value, "v") == pytest.approx(number, rel=1e-5)


@pytest.mark.parametrize(
    ("unit", "value", "number"),
    [
        ("kA", "rms", 3.76533),
        ("kA", "phase rms", 3.76533),
        ("kA", "peak", 5.32498),
        ("A", "phase peak", 5324.98),
    ],
)
def test_a_current_in_amperes(unit, value, number):
    """S_n = √3·V_n·I: 1500/(√3·230) kA."""
    assert BASES.current_unit(unit, None, value, "i") == pytest.approx(number, rel=1e-5)


def test_per_unit_on_another_base():
    """Of a base twice as large, half as many make what is 1 pu on our own, of power and current; of voltage too."""
    assert BASES.voltage_unit("pu", None, None, "v") == 1.0
    assert BASES.voltage_unit("pu", "V_n", None, "v") == 1.0
    assert BASES.voltage_unit("pu", "460 kV", None, "v") == pytest.approx(0.5)
    assert BASES.current_unit("pu", None, None, "i") == 1.0
    assert BASES.current_unit("pu", "3000 MVA", None, "i") == pytest.approx(0.5)
    assert BASES.current_unit("pu", "100 MVA", None, "i") == pytest.approx(15.0)
    assert BASES.power_unit("pu", "750 MVA", "p") == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("unit", "number"),
    [("MW", 1500.0), ("kW", 1.5e6), ("Mvar", 1500.0), ("MVA", 1500.0), ("GW", 1.5)],
)
def test_a_power_in_watts(unit, number):
    assert BASES.power_unit(unit, None, "p") == pytest.approx(number)


@pytest.mark.parametrize(("unit", "number"), [("pu", 1.0), ("Hz", 60.0), ("rad/s", 376.991)])
def test_a_frequency(unit, number):
    assert BASES.frequency_unit(unit, "f") == pytest.approx(number, rel=1e-5)


def test_what_is_not_said_is_asked_for():
    with pytest.raises(ValueError, match="needs the key 'value', one of: line-to-line rms"):
        BASES.voltage_unit("kV", None, None, "v")
    with pytest.raises(ValueError, match="needs the rated voltage"):
        Bases(1500.0, None, 50.0).current_unit("kA", None, "rms", "i")


def test_powers_need_one_sign():
    assert _Reader._power_matrix((-1.0, 0.0, 0.0, -2.0), 3.0) == (-3.0, 0.0, 0.0, -1.5)
    for signs in ((-1.0, 0.0, 0.0, 2.0), (1.0, 0.0, 0.0, -2.0)):
        with pytest.raises(ValueError, match="P and Q need one sign"):
            _Reader._power_matrix(signs, 3.0)


def declared(unit):
    return VariableInfo("x", 0, "Real", "output", "continuous", unit, None, None, None, "")


def test_the_unit_1_is_a_unit():
    """Per unit, unless the binding says more; of an angle it says nothing."""
    assert unit_of(declared("1"), None) == "pu"
    assert unit_of(declared("1"), "kV") == "kV"
    with pytest.raises(ValueError, match="declares no unit for x"):
        unit_of(declared(""), None)
    with pytest.raises(
        ValueError, match='in the unit 1, which says nothing of an angle; add "rad"'
    ):
        angle_unit_of(declared("1"), None)
    assert angle_unit_of(declared("1"), "deg") == "deg"
