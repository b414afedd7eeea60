"""The figures of the page on the latency of the POD controllers: step map, simulation and page agree."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.pod_latency import LOOKS, PODS, delayed_case, latency, percent, rung_down

PAGE = Path(__file__).parents[2] / ".docs" / "validation" / "pod-latency.md"

pytestmark = [pytest.mark.reproduction, pytest.mark.slow]


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return delayed_case("two_area", tmp_path_factory.mktemp("latency"))


def rows(first):
    """Rows of the page's table whose header begins with a text, as lists of cells."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"| {first}"))
    table = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        table.append([cell.strip() for cell in line.strip("|").split("|")])
    return table


def numbers(cell):
    return [float(text) for text in re.findall(r"-?\d+\.?\d*", cell.replace("−", "-"))]


@pytest.mark.parametrize(("column", "pod"), list(enumerate(PODS, start=1)))
def test_the_damping_against_the_delay_is_that_of_the_page_and_of_the_ring_down(case, column, pod):
    with latency(case, pod) as system:
        for row in rows("Delay"):
            (milliseconds,) = numbers(row[0])
            eigenvalue = system.mode(milliseconds / 1e3)
            seen = rung_down(case, pod, milliseconds / 1e3, system, eigenvalue)
            on_page = numbers(row[column])
            assert np.allclose([percent(eigenvalue), percent(seen)], on_page, atol=0.011), (
                row,
                eigenvalue,
                seen,
            )
            assert abs(percent(seen) - percent(eigenvalue)) < 0.3


@pytest.mark.parametrize(("row", "pod"), list(enumerate(PODS)))
def test_the_margins_are_those_of_the_page_and_simulation_agrees_on_both_sides(case, row, pod):
    cells = rows("Two-area")[row]
    with latency(case, pod) as system:
        for cell, least in zip(cells[1:3], (0.0, 0.05), strict=True):
            delay, mode = system.margin(least, *LOOKS["two_area"])
            assert np.allclose([1e3 * delay, mode.imag / (2 * np.pi)], numbers(cell)[:2], atol=0.06)
            if least == 0:
                for factor, grows in ((0.9, False), (1.1, True)):
                    late = round(factor * delay, 4)
                    seen = rung_down(case, pod, late, system, system.worst(late))
                    assert (seen.real > 0) is grows
                    assert abs(seen - system.worst(late)) < 0.01 * abs(seen)
