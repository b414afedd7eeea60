"""Modes and stability against equations written a second time: NumPy and SciPy alone, see tests/reference."""

import ast
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.models.linearization import Blocks, continuous
from orchestrator.linear.spectra.modes import eigenvalues, find_spectrum
from orchestrator.studies.modes.modes import compute_modes, running
from tests.reference.__main__ import REACTANCES, contents, figures, grid_code_rows, two_area_rows
from tests.reference.grid_forming import GFOR
from tests.reference.synchronous_machine import PSS2A, SG1, SG2
from tests.reference.two_areas import SCENARIOS, TwoAreas, grid_code_system, paper_system
from tests.support.exact import exact_continuous, network_of
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.reproduction

FOLDER = Path(__file__).parents[1] / "reference"
NORM = json.loads((FOLDER / "norm631.json").read_text(encoding="utf-8"))
TWO_AREA = json.loads((FOLDER / "two_area.json").read_text(encoding="utf-8"))["independent"]
VALIDATION = Path(__file__).parents[2] / ".docs" / "validation"


# -- the computation itself --------------------------------------------------------------------------


def test_it_knows_nothing_of_the_project():
    allowed = {"numpy", "scipy", *sys.stdlib_module_names}
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += (
                [f"{node.module}.{a.name}" for a in node.names]
                if isinstance(node, ast.ImportFrom)
                else []
            )
            for name in names:
                assert name.startswith("tests.reference.") or name.partition(".")[0] in allowed, (
                    f"{path.name}: {name}"
                )
    assert len(list(FOLDER.glob("*.py"))) >= 6


def test_the_files_are_what_it_computes():
    kept = json.loads((FOLDER / "two_area.json").read_text(encoding="utf-8"))
    assert_rows_agree(kept["independent"], list(two_area_rows()))
    some = (0.01, 0.4)
    assert_rows_agree(
        [r for r in NORM["figures"] if r["X_L"] in some], list(grid_code_rows(ALL_CONVERTERS, some))
    )


@pytest.mark.slow
def test_the_files_are_what_it_computes_to_the_last_row():
    for name, content in contents().items():
        kept = json.loads((FOLDER / name).read_text(encoding="utf-8"))
        assert kept.keys() == content.keys()
        for key, rows in content.items():
            if isinstance(rows, list):
                assert_rows_agree(kept[key], rows)
            else:
                assert kept[key] == rows


ALL_CONVERTERS = list(dict.fromkeys(row["converter"] for row in NORM["figures"]))


def assert_rows_agree(kept, computed):
    assert len(kept) == len(computed) > 0
    for old, new in zip(kept, computed, strict=True):
        ours = {k: v for k, v in new.items() if k not in ("growth", "eigenvalues")}
        assert ours.items() <= old.items()
        assert new["growth"] == pytest.approx(old["growth"], abs=1e-6, rel=1e-6)
        assert np.array(new["eigenvalues"]) == pytest.approx(np.array(old["eigenvalues"]), abs=1e-6)


# -- our models' exact Jacobians, every eigenvalue -----------------------------------------------------


def distances(independent, ours):
    """From every independent eigenvalue to ours, relative; and what ours has beyond them."""
    left = list(ours)
    apart = []
    for value in sorted(independent, key=abs):
        k = int(np.argmin(np.abs(np.array(left) - value)))
        apart.append(abs(left.pop(k) - value) / (1 + abs(value)))
    return np.array(apart), np.array(left)


def assert_same_spectrum(system, case, scenario, overrides, tolerance):
    (prepared,) = case.prepare([scenario], overrides)
    exact = np.linalg.eigvals(exact_continuous(prepared, network_of(case, scenario, overrides))[0])
    apart, beyond = distances(system.linearised().eigenvalues(), exact)
    assert apart.max() < tolerance
    # What our models have beyond are blocks that are left out or switched off: their own poles, real and stable.
    assert np.abs(beyond.imag).max(initial=0) < 1e-6
    assert beyond.real.max(initial=-1) < -0.1


@pytest.mark.parametrize("saturation", [False, True])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_eigenvalue_of_the_two_area_system(scenario, saturation):
    overrides = {"sg1.machine.saturation": saturation, "sg2.machine.saturation": saturation}
    system = paper_system(scenario, 0.1, saturation=saturation)
    assert_same_spectrum(system, load_case("two_area"), scenario, overrides, 1e-9)


@pytest.mark.parametrize("X_L", [0.01, 0.3, 0.6])
@pytest.mark.parametrize("converter", ["base", "gfor", "pod_pq"])
def test_every_eigenvalue_of_the_grid_codes_system(converter, X_L):
    pods = {f"converter.pod_{k}.enabled": True for k in "pq" if converter == "pod_pq"}
    scenario = "without" if converter == "base" else "with"
    # Two equal washouts make a double eigenvalue of -0.5, which rounding splits by its square root.
    system = grid_code_system(converter, X_L)
    assert_same_spectrum(system, load_case("norm631"), scenario, pods | {"grid.X_L": X_L}, 3e-6)


LEFT_ALONE = {
    "S_n",
    "machine.exact_conversion",
    "machine.saturation",
    "governor.enabled",
    "pss.T_6",
    "pss.T_w4",
}
LEFT_ALONE |= {"pod_p.enabled", "pod_q.enabled", "governor.T_1"}


def shaken(data, rng):
    """Every figure another, and none like another's."""
    moved = {}
    for key, value in data.items():
        start = {"governor.T_2": 0.05, "governor.T_7": 0.5, "machine.D": 0.7}.get(
            key, value or 0.07
        )
        moved[key] = value if key in LEFT_ALONE else start * rng.uniform(0.85, 1.15)
    if "machine.X_l" in moved:
        moved["machine.X_l"] *= 0.7  # stays below the subtransient reactances
    return moved


@pytest.mark.parametrize("seed", range(4))
def test_every_eigenvalue_where_no_two_parameters_are_equal(seed):
    """A time constant taken for its neighbour's, or a wrong sign, has nowhere to hide."""
    rng = np.random.default_rng(seed)
    choice = {"machine.exact_conversion": bool(seed % 2), "machine.saturation": seed >= 2}
    sg1, sg2, gfor = (
        shaken(data | extra, rng)
        for data, extra in ((SG1 | PSS2A, choice), (SG2, choice), (GFOR, {}))
    )
    sg1 |= {"governor.T_1": 0.2, "pss.T_6": 0.03, "pss.T_w4": 3.0}  # T_1 = 0 leaves out T_2 as well
    sg2 |= {"governor.T_1": 0.3}
    gfor |= {"pod_p.enabled": True, "pod_q.enabled": True}
    X_L = rng.uniform(0.05, 0.5)
    system = TwoAreas(X_L, gfor, sg1, sg2, loads="current")
    overrides = {"grid.X_L": X_L}
    for name, data in (("sg1", sg1), ("sg2", sg2), ("converter", gfor)):
        overrides |= {f"{name}.{key}": value for key, value in data.items() if key != "S_n"}
    assert_same_spectrum(system, load_case("norm631"), "with", overrides, 1e-7)


@pytest.mark.slow
def test_one_percent_of_any_parameter_is_seen():
    """What the tolerance of the comparison is worth."""
    rng = np.random.default_rng(0)
    parts = {
        "sg1": shaken(SG1 | PSS2A, rng),
        "sg2": shaken(SG2, rng),
        "converter": shaken(GFOR, rng),
    }
    parts["converter"] |= {"pod_p.enabled": True, "pod_q.enabled": True}
    parts["sg1"] |= {"governor.T_1": 0.2}
    parts["sg2"] |= {"governor.T_1": 0.3}

    def spectrum(parts):
        return TwoAreas(0.2, **parts, loads="current").linearised().eigenvalues()

    before = spectrum(parts)
    unseen = []
    for name, data in parts.items():
        for key in data.keys() - LEFT_ALONE - {"machine.s_10", "machine.s_12"}:
            moved = parts | {name: data | {key: data[key] * 1.01}}
            if distances(before, spectrum(moved))[0].max() < 1e-6:
                unseen.append(f"{name}.{key}")
    assert not unseen


# -- our FMUs ----------------------------------------------------------------------------------------


def continuous_eigenvalues(prepared):
    """By perturbing the FMUs' derivatives."""
    with running(prepared) as master:
        return eigenvalues(continuous(Blocks(master, without_step=True)))


@pytest.mark.parametrize("X_L", [0.05, 0.1])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_fmus_continuous_model_has_the_same_modes(scenario, X_L):
    prepared = prepare_one("two_area", scenario, {"grid.X_L": X_L})
    ours = continuous_eigenvalues(prepared)
    for value in paper_system(scenario, X_L).linearised().oscillations(0.1, 2.0):
        assert np.abs(ours - value).min() < 1e-4


def check_grid_code(converter, X_L):
    """Modes, from 0.1 to 1.5 Hz, of the FMUs' step map and of their continuous model; and whether it grows."""
    (row,) = [r for r in NORM["figures"] if (r["converter"], r["X_L"]) == (converter, X_L)]
    scenario = "without" if converter == "base" else "with"
    pods = {f"converter.pod_{k}.enabled": True for k in "pq" if k in converter.removeprefix("pod_")}
    pods = pods if converter.startswith("pod") else {}
    gain = {"converter.pod_q.K": 2000.0} if converter == "pod_q, K × 10" else {}
    case = load_case("norm631")
    (prepared,) = case.prepare([scenario], pods | gain | {"grid.X_L": X_L})
    spectrum = find_spectrum(compute_modes(prepared).model, 0.08, 1.6)
    modes, ours = np.array([m.eigenvalue for m in spectrum.modes]), continuous_eigenvalues(prepared)
    for real, imag in row["eigenvalues"]:
        value = complex(real, imag)
        assert np.abs(ours - value).min() < 1e-4
        assert np.abs(modes - value).min() < 0.002 + 5e-4 * abs(value) + 1e-4 * real**2
    # The common angle's eigenvalue is 0; the communication step moves a mode at 46 Hz by a tenth of 1/s.
    assert ours.real.max() == pytest.approx(max(row["growth"], 0.0), abs=1e-3)
    growth_rate = spectrum.eigenvalues.real.max()
    assert growth_rate == pytest.approx(max(row["growth"], 0.0), abs=0.12)
    assert (growth_rate > 1e-3) == (row["growth"] > 1e-3)


FAST = [
    ("base", 0.5),
    ("gfor", 0.05),
    ("pod_p", 0.4),
    ("pod_q, K × 10", 0.1),
    ("pod_q, K × 10", 0.2),
]


@pytest.mark.parametrize(("converter", "X_L"), FAST)
def test_the_grid_codes_figures_are_the_fmus(converter, X_L):
    check_grid_code(converter, X_L)


@pytest.mark.slow
@pytest.mark.parametrize("converter", ["base", "gfor", "pod_p", "pod_q, K × 10"])
def test_the_grid_codes_figures_are_the_fmus_at_every_reactance(converter):
    for X_L in REACTANCES:
        check_grid_code(converter, X_L)


# -- the pages' figures --------------------------------------------------------------------------------


def least_damped(rows):
    """Damping [%], frequency [Hz] and reactance of the least damped mode of all rows."""
    found = [
        (-100 * real / abs(complex(real, imag)), imag / (2 * np.pi), row["X_L"])
        for row in rows
        for real, imag in row["eigenvalues"]
    ]
    return min(found)


PAGE_ROWS = {
    "none (the base system with PSS2A)": "base",
    "ours, no POD": "gfor",
    "POD-P": "pod_p",
    "POD-Q": "pod_q",
    "POD-PQ": "pod_pq",
    "POD-P, sign turned, K × 10": "pod_p, sign turned, K × 10",
    "POD-P, sign turned, K = 200": "pod_p, sign turned",
    "POD-Q, sign turned, K × 10": "pod_q, sign turned, K × 10",
    "POD-Q, K × 10": "pod_q, K × 10",
    "POD-Q, sign turned, K = 200": "pod_q, sign turned",
}


@pytest.mark.parametrize("label", PAGE_ROWS)
def test_the_table_of_the_grid_codes_test(label):
    table = (VALIDATION / "damping-test.md").read_text(encoding="utf-8")
    line = next(x for x in table.splitlines() if x.startswith(f"| {label} |"))
    cell = line.split("|")[2].replace("−", "-")
    numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*", cell)]
    rows = [row for row in NORM["figures"] if row["converter"] == PAGE_ROWS[label]]
    damping, frequency, X_L = least_damped(rows)
    assert len(rows) == 13
    assert numbers[0] == pytest.approx(damping, abs=0.1)  # the step map's, to three digits
    assert numbers[-1] == X_L
    assert len(numbers) == 2 or numbers[1] == pytest.approx(frequency, abs=0.002)


def test_what_the_page_says_beside_the_table():
    def growing(converter):
        return [
            r["X_L"] for r in NORM["figures"] if r["converter"] == converter and r["growth"] > 1e-3
        ]

    assert growing("pod_q, K × 10") == [0.01, 0.05, 0.1, 0.15]
    for converter in ("base", "gfor", "pod_p", "pod_q", "pod_pq", "pod_q, sign turned"):
        assert growing(converter) == []
    for converter in (
        "pod_p, sign turned, K × 10",
        "pod_p, sign turned",
        "pod_q, sign turned, K × 10",
    ):
        assert growing(converter) == list(REACTANCES)
    fastest = max(
        r["growth"] for r in NORM["figures"] if r["converter"] == "pod_p, sign turned, K × 10"
    )
    assert fastest == pytest.approx(286, abs=1)
    without = {r["X_L"]: least_damped([r])[0] for r in NORM["without stabiliser"]}
    assert [X_L for X_L, damping in without.items() if damping < 0] == list(REACTANCES[2:])
    assert without[0.1] == pytest.approx(-1.1, abs=0.05)
    assert without[0.6] == pytest.approx(-8.7, abs=0.05)


def test_the_lag_of_a_constant_current_load_hardly_matters():
    """1 ms, against a load that follows at once: there |v| is a Lagrange multiplier, and the equations have index 2."""
    for converter in SCENARIOS:
        for row in (r for r in NORM["current at once"] if r["converter"] == converter):
            (lagged,) = [
                r for r in NORM["figures"] if (r["converter"], r["X_L"]) == (converter, row["X_L"])
            ]
            assert least_damped([row])[0] == pytest.approx(least_damped([lagged])[0], abs=0.08)


SATURATION_TABLE = {
    "base": "Base (only SG)",
    "gfor": "SG + GFOR",
    "pod_p": "POD-P",
    "pod_q": "POD-Q",
    "pod_pq": "POD-PQ",
}


@pytest.mark.parametrize("scenario", SATURATION_TABLE)
@pytest.mark.parametrize("saturation", [False, True])
def test_the_table_of_the_paper(scenario, saturation):
    section = (VALIDATION / "two-area.md").read_text(encoding="utf-8")
    line = next(
        x for x in section.splitlines() if x.startswith(f"| {SATURATION_TABLE[scenario]} |")
    )
    cells = [c.replace("−", "-") for c in line.split("|")[4 + 2 * saturation : 6 + 2 * saturation]]
    real, imag = (float(x) for x in re.findall(r"-?\d+\.\d+", cells[0]))
    (row,) = [
        r
        for r in TWO_AREA
        if (r["X_L"], r["scenario"], r["saturation"], r["governor_on_sg1"])
        == (0.1, scenario, saturation, True)
    ]
    value = min(
        (complex(*z) for z in row["eigenvalues"]), key=lambda z: abs(z - complex(real, imag))
    )
    assert abs(value - complex(real, imag)) < 0.002
    assert float(cells[1]) == pytest.approx(-100 * value.real / abs(value), abs=0.03)


def test_the_figures_name_what_grows():
    """The computation finds growth outside of the range that it lists."""
    fast = grid_code_system("pod_p, sign turned, K × 10", 0.3).linearised()
    found = figures(fast, 0.1, 1.5)
    assert found["growth"] == pytest.approx(fast.eigenvalues().real.max())
    assert all(real < 0 for real, _ in found["eigenvalues"])
