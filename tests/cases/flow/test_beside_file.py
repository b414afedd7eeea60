"""A power flow beside its file's voltages: how far apart, and what is told as the cause."""

import pytest

from orchestrator.cases.flow.beside_file import FileVoltages, compare_with_file
from orchestrator.cases.flow.power_flow import (
    FlowLine,
    FlowLoad,
    FlowShunt,
    FlowUnit,
    solve_power_flow,
)

STRAY = 0.05


def flow(*, drawn=80.0, held=1.0, fed=0.3, near=0.2, stray=0.0):
    """A ring of two sources and a load."""
    lines = [
        FlowLine("one", "source", "load", R=0.01, X=0.1, B=0.02),
        FlowLine("two", "load", "second", R=0.02, X=0.2, B=0.04),
        FlowLine("three", "second", "source", R=0.02, X=near, B=0.04),
    ]
    units = [
        FlowUnit("g1", "source", S_n=200.0, P_0=0.0, v_0=1.02),
        FlowUnit("g2", "second", S_n=100.0, P_0=fed, v_0=held),
    ]
    return solve_power_flow(
        ["source", "load", "second"],
        lines,
        [FlowLoad("load", drawn, 30.0)],
        units,
        "source",
        [FlowShunt("load", 0.0, stray, stray=True)],
    )


def of_file(solution, turn=1.0):
    return FileVoltages({bus: turn * v for bus, v in solution.voltages.items()}, 5e-6)


def test_the_files_own_solution_is_near_also_with_another_reference_of_the_angles():
    found = compare_with_file(flow(), of_file(flow(), turn=1j))
    assert found.difference < 1e-12
    assert found.in_words.startswith("within ")
    assert not found.cause


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"drawn": 83.0}, "do not fulfil its own data, which leave +3 MW"),
        ({"held": 1.01}, "second, whose unit holds its voltage, has 1 pu for 1.01 in the file"),
    ],
)
def test_the_cause_is_named_with_its_bus_and_size(other, words):
    theirs = flow(**other)
    found = compare_with_file(flow(), of_file(theirs))
    apart = max(abs(theirs.voltages[bus] - v) for bus, v in flow().voltages.items())
    assert found.difference == pytest.approx(apart)
    assert words in found.cause
    assert "; and" not in found.cause
    assert found.bus in found.in_words


def test_the_bus_with_the_most_apparent_power_is_named_whatever_moves_the_worst_voltage():
    """A bus next to the source: its 20 MW move the load's voltage less than the 10 MW at the load itself."""
    theirs = flow(drawn=90.0, fed=0.1, near=0.02)
    found = compare_with_file(flow(near=0.02), of_file(theirs))
    assert found.bus == "load"
    assert "which leave +20 MW at second and less elsewhere" in found.cause


def test_two_causes_of_like_effect_are_both_told():
    cause = compare_with_file(flow(), of_file(flow(drawn=90.0, held=1.01))).cause
    assert "+10 MW" in cause
    assert "second, whose unit" in cause


def test_a_device_and_stray_capacitance_are_told_as_such():
    at_device = compare_with_file(flow(), of_file(flow(drawn=83.0)), ["load"])
    assert "a DC line, FACTS device or the like feeds another power" in at_device.cause
    stray = compare_with_file(flow(stray=STRAY), of_file(flow()))
    assert stray.cause == "stray_B of EMT models, which the file does not have"


def test_digits_of_the_file_need_no_cause_and_a_file_without_solution_no_line():
    coarse = FileVoltages(of_file(flow(drawn=80.5)).at, rounding=1e-3)
    found = compare_with_file(flow(), coarse)
    assert found.difference > 1e-4
    assert found.in_words.endswith("which its digits leave open")
    assert compare_with_file(flow(), FileVoltages()) is None
