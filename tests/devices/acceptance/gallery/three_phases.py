"""Devices with three phases, of phases.c: honest ones, and ones with a fault that a balanced voltage does not show."""

from dataclasses import replace
from math import sqrt

from tests.devices.acceptance.gallery.members import START, Member, binding, converter

_PEAK = repr(230.0 * sqrt(2 / 3))


def three_phase(name, fault="", only=(), **defines):
    """One of them, in kV, kA and MW behind a binding that declares 1.2 pu of current."""
    usual = {"V_UNIT": _PEAK, "P_UNIT": "1500.0"}
    source = converter(name, "abc", units=("kV", "kA", "MW"), **usual)
    kept = {key: value for key, value in source.defines.items() if key not in (*usual, "PORT_ABC")}
    source = replace(source, file="phases.c", defines={**kept, **defines})
    start = START.replace('variable = "v_0"', 'variable = "v_0"\nvalue = "phase peak"')
    bound = binding("abc", start=start).replace("[voltage]", 'I_max = "1.2 pu"\n[voltage]')
    return Member(source, fault, bound, only=only)


def honest():
    """A voltage behind an impedance, a balanced current, and a rule for the negative sequence."""
    return [
        three_phase("voltage_behind_impedance"),
        three_phase("balanced_current", FOLLOWS=1.0),
        three_phase("negative_sequence_control", FOLLOWS=0.5),
    ]


def planted():
    return [
        three_phase("limit_of_the_mean", "above its limit in one phase", FAULT_LIMITS_MEAN=1),
        three_phase(
            "lost_lock", "trips in an unbalanced dip", FOLLOWS=1.0, FAULT_LOSES_ITS_LOCK=0.02
        ),
        three_phase("swapped_both", "phases swapped", FAULT_SWAPS_VOLTAGE=1, FAULT_SWAPS_CURRENT=1),
        three_phase("swapped_current", "phases swapped", FAULT_SWAPS_CURRENT=1),
        three_phase("swapped_voltage", "phases swapped", FAULT_SWAPS_VOLTAGE=1),
        three_phase(
            "swings_with_it",
            "keeps moving",
            ("phase_order", "negative_sequence"),
            FAULT_SWINGS=0.05,
        ),
        three_phase("amplifies", "amplifies the negative sequence", FOLLOWS=3.5),
    ]
