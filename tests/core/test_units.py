"""Quantities as people write them, in the unit that is declared for them."""

import math
import re

import pytest

from orchestrator.core.units import (
    USUAL,
    _counts_alike,
    base_exponents,
    pint_factor,
    to_unit,
    whole_percent,
)


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (0.3, "pu", 0.3),
        (7, "MW", 7.0),
        ("1350 MW", "MW", 1350.0),
        ("1.35 GW", "MW", 1350.0),
        ("-2e3 kW", "MW", -2.0),
        ("1500 MVA", "MVA", 1500.0),
        ("0.1 GVA", "MVA", 100.0),
        ("100 Mvar", "Mvar", 100.0),
        ("250 kvar", "Mvar", 0.25),
        ("100 us", "s", 1e-4),
        ("100 µs", "s", 1e-4),
        ("5 ms", "s", 5e-3),
        ("2 min", "s", 120.0),
        ("180 deg", "rad", math.pi),
        ("50 Hz", "Hz", 50.0),
        ("0.05 pu", "pu", 0.05),
        ("0.05", "pu", 0.05),
        ("3", "1", 3.0),
        ("10 %", "1", 0.1),
        ("3", "", 3.0),
        ("2 kHz", "Hz", 2000.0),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 revolution/s", "rad/s", 2 * math.pi),
        ("180 deg/s", "rad/s", math.pi),
        ("3 s^-1", "1/s", 3.0),
        ("3 rad/s", "1/s", 3.0),
        ("0.5 Hz/s", "Hz/s", 0.5),
        ("1 MW/Hz", "kW/Hz", 1000.0),
        ("0.25 turn", "rad", math.pi / 2),
    ],
)
def test_a_quantity_in_the_declared_unit(value, unit, expected):
    converted = to_unit(value, unit)
    assert isinstance(converted, float)
    assert converted == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        ("0.1 MW", "pu", "'0.1 MW' is in MW, but pu is needed"),
        ("5 m", "s", "'5 m' is in m, but s is needed"),
        ("1 s", "MW", "'1 s' is in s, but MW is needed"),
        ("2 pu", "", "'2 pu' is in pu, but a plain number is needed"),
        ("10 MW", "1", "'10 MW' is in MW, but"),
        ("5 pu", "MW", "'5 pu' is in pu, but MW is needed"),
    ],
)
def test_a_unit_that_does_not_fit_is_named_beside_the_one_that_is_needed(value, unit, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the words are compared below
        to_unit(value, unit)
    assert str(caught.value).startswith(words)


@pytest.mark.parametrize("value", ["", "large", "5 quux", "1/0", "__import__('os')", "5 5 +"])
def test_a_text_that_is_no_quantity(value):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the words are compared below
        to_unit(value, "s")
    assert str(caught.value).startswith(repr(value))
    assert re.search("is not a number with a unit|is unknown", str(caught.value))


@pytest.mark.parametrize("value", ["0,9 GW", "1,5 GW", "1 350 MW", "1.350,5 MW"])
def test_a_decimal_comma_or_a_blank_inside_a_number_is_refused_or_understood(value):
    meant = {"0,9 GW": 900.0, "1,5 GW": 1500.0, "1 350 MW": 1350.0, "1.350,5 MW": 1350.5}[value]
    try:
        converted = to_unit(value, "MW")
    except ValueError:
        return
    assert converted == pytest.approx(meant)


@pytest.mark.parametrize(
    ("value", "unit"),
    [
        ("50 Hz", "rad/s"),
        ("50 Hz", "deg/s"),
        ("50 Hz", "rpm"),
        ("60 Hz", "1/s"),
        ("2 kHz", "rad/s"),
        ("314.159 rad/s", "Hz"),
        ("18000 deg/s", "Hz"),
        ("1 revolution/s", "Hz"),
        ("1 rpm", "Hz"),
        ("60 s^-1", "Hz"),
        ("60 rpm", "1/s"),
        ("3 s^-1", "rpm"),
        ("1 turn", "1"),
        ("1 rad/s/s", "Hz/s"),
        ("1 MW/Hz", "MW*s/rad"),
        ("1 MW*s/rad", "MW/Hz"),
    ],
)
def test_cycles_and_angles_are_not_taken_for_one_another(value, unit):
    """A conversion that loses the 2π gives a plausible wrong number."""
    with pytest.raises(ValueError, match="is needed; 1 Hz is 2π rad/s, or 60 rpm") as caught:
        to_unit(value, unit)
    assert str(caught.value).startswith(repr(value))


@pytest.mark.parametrize(
    ("given", "declared"), [(g, d) for d, factors in USUAL.items() for g in factors]
)
def test_factors_of_usual_units_are_those_of_pint_to_the_last_bit(given, declared):
    assert USUAL[declared][given] == pint_factor(given, declared)
    assert _counts_alike(given, declared)


def test_units_that_differ_in_their_zero():
    assert to_unit("20 degC", "K") == pytest.approx(293.15, abs=1e-12)
    assert to_unit("300 K", "degC") == pytest.approx(26.85, abs=1e-12)
    assert base_exponents("degC") == (1.0, {"K": 1})


@pytest.mark.parametrize(
    ("part", "whole", "expected"),
    [(0.284, 1.0, "28 %"), (1.0, 1.0, "100 %"), (-0.04, 1.0, "-4 %"), (508.4, 750, "68 %")],
)
def test_a_part_is_said_in_whole_percent(part, whole, expected):
    assert whole_percent(part, whole) == expected
