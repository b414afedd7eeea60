"""RTE's envelopes: against published curves, against an integration of the equations, and with wrong declarations."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestrator.core.errors import InputError
from orchestrator.face.cli import certify_matrix
from orchestrator.studies.certification.codes import envelope as e
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import BenchResult
from orchestrator.studies.certification.codes.known import code_for, codes_by_declaration
from orchestrator.studies.certification.codes.row_verdict import judge_row
from orchestrator.studies.certification.codes.rte import DECLARED, Envelope, rte_code
from orchestrator.studies.certification.matrix import MatrixCell
from orchestrator.studies.certification.verdict import PASSES

OMEGA_PUBLISHED = 314.0
"""ω_b of the published curves [rad/s]."""

SAMPLE_1, SAMPLE_2 = 5 / 2999, 6 / 2999
"""Their sampling [s]: IGFM1 and 2 from 0 to 5 s, IGFM3 and 4 from −1 to 5 s. Their delays are whole samples, rounded
down: 11 (or 9) of the 20 ms, 5 of the 10 ms."""

# Time [s], response, lower and upper bound [pu], from the CSV files of dynawo/dyn-grid-compliance-verification under
# docs/GFM_envelopes_curves/Envelopes, commits 56bd1da and b7576cb (IGFM3: e47b58b), MPL-2.0, © RTE.
JUMP_OVERDAMPED = """
0.02001 0.8000 0.5013 0.9187
0.02501 0.7995 0.5009 0.9183
0.02668 0.7992 0.6208 0.9180
0.05002 0.7896 0.6169 0.9062
0.08003 0.7674 0.6071 0.8770
0.10000 0.7494 0.5689 0.8529
0.20010 0.6576 0.4656 0.7289
0.30010 0.5911 0.4484 0.6391
0.40010 0.5508 0.4572 0.5851
0.50020 0.5279 0.4685 0.5601
0.60020 0.5152 0.4760 0.5454
"""  # Overdamped/PCS_RTE-IGFM1/S_VolAngStep2/OC2
JUMP_UNDERDAMPED = """
0.02001 0.7957 0.5013 0.9187
0.02501 0.7830 0.5009 0.9191
0.02668 0.7787 0.6808 0.9192
0.05002 0.7197 0.6603 0.8767
0.10000 0.6045 0.5696 0.8001
0.20010 0.4576 0.4441 0.6926
0.30010 0.4225 0.3931 0.6262
0.40010 0.4485 0.4019 0.5853
0.50020 0.4849 0.4471 0.5600
0.60020 0.5067 0.4861 0.5445
"""  # Underdamped/PCS_RTE-IGFM1/S_VolAngStep2/OC2
AMPLITUDE = """
0.02001 nan 0.04782 0.2123
0.02334 nan 0.1026 0.2073
0.03001 nan 0.1300 0.1990
0.05002 nan 0.1300 0.1837
0.09670 nan 0.1300 0.1724
0.09837 nan 0.1300 0.1700
"""  # Overdamped/PCS_RTE-IGFM2/S_VolAmpStep1/OC1; its own response is not delayed
STRENGTH = """
0.01834 0.2403 0.1683 0.3751
0.05035 0.2448 0.1730 0.3724
0.10040 0.2621 0.1929 0.3810
0.20040 0.3054 0.2401 0.4027
0.30040 0.3445 0.2798 0.4222
0.40050 0.3763 0.3130 0.4382
0.41650 0.3808 0.3178 0.4407
0.50050 0.4018 0.3407 0.4601
0.70060 0.4381 0.3831 0.4898
"""  # Overdamped/PCS_RTE-IGFM3/S_SCRdown1/OC2
RAMP_OVERDAMPED = """
0.02034 0.5000 0.4760 0.5241
0.05035 0.5077 0.4797 0.5344
0.10040 0.5391 0.4935 0.5806
0.20040 0.6190 0.5248 0.7162
0.30040 0.6915 0.5522 0.8509
0.40050 0.7506 0.5752 0.9612
0.50050 0.7978 0.5943 1.0450
0.70060 0.7459 0.5748 0.9579
"""  # Overdamped/PCS_RTE-IGFM4/S_Rocof4/OC2
RAMP_UNDERDAMPED = """
0.02034 0.5001 0.4800 0.5201
0.05035 0.5168 0.4882 0.5423
0.10040 0.5928 0.5231 0.6489
0.15040 0.6973 0.5671 0.8085
0.20040 0.8023 0.6078 0.9841
0.50050 0.9895 0.6786 nan
0.60050 0.8648 0.6306 1.1550
0.70060 0.6329 0.5425 0.7325
0.71260 0.6082 0.5337 0.6838
0.72660 0.5812 0.5206 0.6350
0.75660 0.5305 0.4813 0.5896
"""  # Underdamped/PCS_RTE-IGFM4/S_Rocof8/OC2

STRONG_GRID, WEAK_GRID = 0.27 + 0.1, 0.27 + 0.5
SLOW, QUICK = (200.0, 5.0), (95.0, 5.0)
"""D and H of the overdamped and the underdamped curves; X_eff is 0.27 pu."""


def plant(values, X):
    return e.Swinging(*values, X, OMEGA_PUBLISHED)


PUBLISHED = {
    "jump, overdamped": (
        JUMP_OVERDAMPED,
        11 * SAMPLE_1,
        1,
        e.jump_bounds(plant(SLOW, STRONG_GRID), 0.3 * STRONG_GRID),
    ),
    "jump, underdamped": (
        JUMP_UNDERDAMPED,
        11 * SAMPLE_1,
        1,
        e.jump_bounds(plant(QUICK, STRONG_GRID), 0.3 * STRONG_GRID),
    ),
    "amplitude": (AMPLITUDE, 11 * SAMPLE_1, 1, e.amplitude_bounds(0.15)),
    "strength": (
        STRENGTH,
        9 * SAMPLE_2,
        -1,
        e.strength_bounds(plant(SLOW, WEAK_GRID), 0.5 * 0.4 / WEAK_GRID),
    ),
    "ramp, overdamped": (
        RAMP_OVERDAMPED,
        9 * SAMPLE_2,
        1,
        e.ramp_bounds(plant(SLOW, WEAK_GRID), -0.04, 0.5),
    ),
    "ramp, underdamped": (
        RAMP_UNDERDAMPED,
        9 * SAMPLE_2,
        1,
        e.ramp_bounds(plant(QUICK, STRONG_GRID), -0.04, 0.5),
    ),
}


@pytest.mark.parametrize("case", PUBLISHED)
def test_the_bounds_are_the_published_ones(case, monkeypatch):
    """Within 2e-4 pu; the curves are printed to 1e-4 pu, above 1 pu to 1e-3 pu."""
    text, delay, sign, bounds = PUBLISHED[case]
    monkeypatch.setattr(e, "SLACK", 5 * SAMPLE_1)
    t, response, lower, upper = np.array(
        [line.split() for line in text.split("\n") if line], dtype=float
    ).T
    found = bounds(np.maximum(t - delay, 0))
    before = 0.0 if case == "amplitude" else 0.5
    edges = np.sort([before + sign * found.asked, before + sign * found.allowed], axis=0)
    for ours, theirs in (
        (before + sign * found.ideal, response),
        (edges[0], lower),
        (edges[1], upper),
    ):
        known = np.isfinite(theirs)
        tolerance = np.where(theirs[known] > 1, 6e-4, 2e-4)
        assert (np.abs(ours[known] - theirs[known]) < tolerance).all()


def test_the_bounds_after_a_step_of_the_strength_end_in_the_tunnel():
    late = np.array([10.0, 20.0])
    quick = e.strength_bounds(plant(QUICK, STRONG_GRID), 0.2)(late)
    slow = e.strength_bounds(plant(SLOW, STRONG_GRID), 0.2)(late)
    assert quick.allowed == pytest.approx(slow.allowed, abs=1e-3)


def test_the_curves_between_oscillating_and_not_are_continuous():
    """At ζ = 1 both roots are one."""
    t = np.linspace(0, 2, 200)
    D = 2 * math.sqrt(2 * 5 * OMEGA_PUBLISHED / WEAK_GRID)
    for of in (e.Swinging.dying, e.Swinging.ramping):
        below, at, above = (
            of(plant((D * factor, 5.0), WEAK_GRID), t) for factor in (0.9999, 1.0, 1.0001)
        )
        assert np.abs(at - (below + above) / 2).max() < 1e-4


TIMES = np.arange(0, 40.0005, 1e-3)


def integrated(row, declared, actual, power):
    """Responses of a voltage source behind a reactance whose angle obeys a swing equation; nothing of the product's
    formulas is in it. The grid is a source behind 1/SCR; both voltages are 1 pu at the start.
    """
    made = row.programme(50.0)
    X_eff, D, H = (actual[name] for name in ("X_eff", "D", "H"))
    state = {"X": 1 / made.scr, "jump": 0.0, "factor": 1.0, "rise": 0.0}
    # δ, ω, grid's angle, its ω, ω behind the lag
    x = [math.asin(power * (X_eff + 1 / made.scr)), 0.0, 0.0, 0.0, 0.0]
    times, p, v, q = [], [], [], []
    X_start = 1 / made.scr
    for begin, end in zip((0.0, *made.times), (*made.times, made.stop), strict=True):
        for change in made.changes:
            if change.time == begin:
                name = change.parameter.removeprefix("source.")
                state["X" if name == "X_factor" else name] = change.value * (
                    X_start if name == "X_factor" else 1
                )
        t = TIMES[(begin - 1e-9 < TIMES) & (end - 1e-9 > TIMES)]
        s = dict(state)

        def rates(_, y, s=s):
            P = s["factor"] * np.sin(y[0] - y[2] - s["jump"]) / (X_eff + s["X"])
            return [
                2 * np.pi * 50 * y[1],
                (power - P + D * (y[4] - y[1])) / (2 * H),
                2 * np.pi * 50 * y[3],
                s["rise"],
                (y[3] - y[4]) / 0.01,
            ]

        found = solve_ivp(
            rates, (begin, end), x, t_eval=[*t, end], rtol=1e-8, atol=1e-10, max_step=0.02
        )
        x = found.y[:, -1].tolist()
        inner = np.exp(1j * found.y[0, :-1])
        outer = s["factor"] * np.exp(1j * (found.y[2, :-1] + s["jump"]))
        current = (inner - outer) / (1j * (X_eff + s["X"]))
        bus = outer + 1j * s["X"] * current
        apparent = bus * np.conj(current)
        times.append(t), p.append(apparent.real), q.append(apparent.imag), v.append(np.abs(bus))
    series = {"p": p, "q": q, "v": v}
    return BenchResult(
        row.name, np.concatenate(times), {n: np.concatenate(x) for n, x in series.items()}
    )


DAMPED = {"X_eff": 0.27, "D": 200.0, "H": 5.0}
SWINGING = {"X_eff": 0.27, "D": 95.0, "H": 5.0}
ROWS = (
    "igfm1_scr10_p50",
    "igfm1_scr2_pm50",
    "igfm2_scr10_p0",
    "igfm3_scr10_p50_scr2",
    "igfm4_scr10_p0_0_5",
    "igfm4_scr2_p0_2",
)


def judged(declared, actual, name):
    row = next(row for row in rte_code(declared).rows if row.name == name)
    power = float(name.split("_")[2].removeprefix("p").replace("m", "-")) / 100
    return judge_row(row, integrated(row, declared, actual, power), 50.0)


@pytest.mark.parametrize("values", [DAMPED, SWINGING], ids=["damped", "swinging"])
@pytest.mark.parametrize("name", ROWS)
def test_an_ideal_source_stays_within_its_envelope(values, name):
    found = judged(values, values, name)
    assert found.accepted, [finding.text for finding in found.failed]


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        ({"H": 20.0}, "igfm1_scr10_p50"),
        ({"H": 20.0}, "igfm4_scr10_p0_0_5"),
        ({"H": 1.0}, "igfm4_scr10_p0_0_5"),
        ({"D": 5.0}, "igfm1_scr10_p50"),
        ({"D": 5.0}, "igfm3_scr10_p50_scr2"),
        ({"X_eff": 1.5}, "igfm1_scr10_p50"),
        ({"X_eff": 0.6}, "igfm2_scr10_p0"),
        ({"X_eff": 0.1}, "igfm2_scr10_p0"),
    ],
)
def test_another_inertia_damping_or_reactance_than_declared_falls_out(wrong, name):
    assert not judged(DAMPED, DAMPED | wrong, name).accepted


@pytest.mark.parametrize("name", ROWS)
def test_a_constant_current_falls_out_of_every_envelope(name):
    row = next(row for row in rte_code(SWINGING).rows if row.name == name)
    made = row.programme(50.0)
    times = TIMES[made.stop + 1e-9 > TIMES]
    power = float(name.split("_")[2].removeprefix("p").replace("m", "-")) / 100
    signals = {"p": np.full_like(times, power), "q": np.zeros_like(times), "v": np.ones_like(times)}
    found = judge_row(row, BenchResult(name, times, signals), 50.0)
    assert not found.accepted
    assert all("within the envelope" in finding.rule for finding in found.failed)


def changed(name, change, values=DAMPED):
    """The verdict on the ideal response after a change of its power, which gets times and power [s, pu]."""
    row = next(row for row in rte_code(values).rows if row.name == name)
    result = integrated(row, values, values, 0.0 if "_p0" in name else 0.5)
    result.signals["p"] = change(result.times, result.signals["p"])
    return [finding.criterion for finding in judge_row(row, result, 50.0).failed]


@pytest.mark.parametrize(
    ("name", "time", "criterion"),
    [
        ("igfm1_scr10_p50", 4.0, "power after the jump ahead"),
        ("igfm1_scr10_p50", 9.0, "power after the jump back"),
        ("igfm4_scr2_p0_2", 10.0, "power while the frequency rises"),
        ("igfm4_scr2_p0_2", 15.0, "power while the frequency falls"),
    ],
)
def test_a_late_excursion_is_seen(name, time, criterion):
    """Seconds after the jump, and long after the end of the ramp; each by the criterion of its own event."""
    assert not changed(name, lambda times, p: p)
    assert criterion in changed(name, lambda times, p: p + 0.2 * (np.abs(times - time) < 0.05))


def test_more_is_allowed_while_the_frequency_rises_than_while_it_falls():
    """1.5 and 1.3 times the largest variation."""
    assert changed("igfm4_scr2_p0_2", lambda times, p: 1.68 * p) == [
        "power while the frequency falls"
    ]


@pytest.mark.parametrize(("late", "accepted"), [(0.015, True), (0.026, False)])
def test_after_a_step_of_the_grid_half_of_the_power_is_asked_for_from_30_ms_on(late, accepted):
    shift = round(late / 1e-3)
    failed = changed(
        "igfm3_scr10_p50_scr2", lambda times, p: np.concatenate([np.full(shift, 0.5), p[:-shift]])
    )
    assert (failed == []) == accepted


def test_power_is_limited_and_current_is_not():
    wide = e.Bounds(*(np.full(2, distance) for distance in (2.0, 1.5, 3.0)))
    times = np.array([1.0, 2.0])
    assert np.allclose(
        Envelope(lambda t: wide, -1).between(times, 0.5), [[-1.2, -1.2], [-0.98, -0.98]]
    )
    assert np.allclose(
        Envelope(lambda t: wide, 1, limited=False).between(times, 0.5), [[2.0, 2.0], [3.5, 3.5]]
    )


def test_nothing_is_asked_for_before_a_mean_over_a_period_can_respond():
    bounds = e.jump_bounds(plant(SLOW, STRONG_GRID), 0.3 * STRONG_GRID)
    lower, upper = Envelope(bounds, 1).between(np.array([0.0, 0.019, 0.05]), 0.5)
    assert lower[:2].tolist() == [0.48, 0.48]
    assert lower[2] > 0.6
    assert (upper > 0.9).all()


def test_a_response_that_is_no_number_is_not_inside():
    row = next(row for row in rte_code(SWINGING).rows if row.name == "igfm1_scr10_p50")
    result = integrated(row, SWINGING, SWINGING, 0.5)
    result.signals["p"][3000:] = np.nan
    found = judge_row(row, result, 50.0)
    assert not found.accepted
    assert "within the envelope" in " ".join(finding.rule for finding in found.failed)


def test_the_worst_instant_is_told():
    found = judged(DAMPED, DAMPED | {"D": 5.0}, "igfm1_scr10_p50").failed[0]
    assert found.value > 0
    assert found.margin < 0
    assert "ms" in found.text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "missing: X_eff (effective reactance"),
        ({"X_eff": 0.2, "D": 20.0}, "Add --declare H=…"),
        (
            {"X_eff": 0.2, "D": 20.0, "H": 1.0, "K": 3.0},
            "--declare K: --code rte knows no such value",
        ),
        ({"X_eff": -0.2, "D": 20.0, "H": 1.0}, "--declare X_eff=-0.2: the effective reactance"),
        (
            {"X_eff": 0.2, "D": 20.0, "H": "big"},
            "--declare H=big: the inertia constant is a number",
        ),
        ({"X_eff": 0.2, "D": True, "H": 1.0}, "--declare D=True"),
        ({"X_eff": 0.2, "D": float("nan"), "H": 1.0}, "--declare D=nan"),
    ],
)
def test_a_declaration_that_cannot_be_used_is_one_error(given, said):
    with pytest.raises(InputError) as error:
        code_for("rte", given)
    assert said in str(error.value)


def test_a_code_without_declarations_takes_none():
    with pytest.raises(InputError, match="--declare D: --code miso knows no such value"):
        code_for("miso", {"D": 3.0})
    assert set(codes_by_declaration()).isdisjoint(CODES)


def test_every_row_of_rte_is_named_for_a_file_and_told_in_words():
    code = rte_code({d.name: 1.0 for d in DECLARED})
    names = [row.name for row in code.rows]
    assert len(names) == len(set(names)) == 32
    assert all(name.replace("_", "").isalnum() for name in names)


@pytest.mark.parametrize(
    ("declare", "codes", "answer"),
    [
        (
            [],
            [
                "nts631",
                "miso",
                "aemo",
                "ercot",
                "nogrr245",
                "fingrid",
                "prc029",
                "tr331",
                "gb",
                "frequency",
            ],
            3,
        ),
        (
            ["D=2.0"],
            [
                "nts631",
                "miso",
                "aemo",
                "ercot",
                "nogrr245",
                "fingrid",
                "prc029",
                "tr331",
                "rte",
                "gb",
                "frequency",
            ],
            0,
        ),
    ],
)
def test_all_codes_leave_out_what_nothing_is_declared_for(
    declare, codes, answer, monkeypatch, gfor, tmp_path
):
    """It is said, and the test is incomplete; only the code that asks for declarations gets them."""
    asked = []

    def noted(options, device, key, folder, place, console, *, several):
        asked.append((key, options.declare))
        return MatrixCell(device.name, key, place, verdict=PASSES)

    monkeypatch.setattr(certify_matrix, "_tested", noted)
    words = [word for value in declare for word in ("--declare", value)]
    code, text, _ = gfor("certify", tmp_path / "x.fmu", "--code", "all", "--out", tmp_path, *words)
    assert code == answer
    assert [key for key, _ in asked] == codes
    assert all(given == ([("D", 2.0)] if declare and key == "rte" else []) for key, given in asked)
    assert ("Left out, as it needs --declare: rte" in text) == (not declare)


def test_json_lists_the_cells_of_all_devices(monkeypatch, gfor, tmp_path):
    monkeypatch.setattr(
        certify_matrix,
        "_tested",
        lambda options, device, key, folder, place, console, *, several: MatrixCell(
            device.name, key, place, verdict=PASSES
        ),
    )
    files = tmp_path / "x.fmu", tmp_path / "y.fmu"
    code, text, said = gfor("certify", *files, "--code", "miso", "--out", tmp_path, "--json")
    assert code == 0, said
    assert [(cell["device"], cell["code"]) for cell in json.loads(text)["cells"]] == [
        ("x", "miso"),
        ("y", "miso"),
    ]


@pytest.mark.parametrize(
    "words", [("--pdf",), ("--check", "report.json"), ("--details", "mine.toml", "--pdf")]
)
def test_figures_without_a_certificate_refuse_what_a_certificate_has(words, gfor, tmp_path):
    code, _, said = gfor("certify", tmp_path / "x.fmu", "--code", "gb", *words)
    assert code == 2
    assert ", ".join(sorted(w for w in words if w.startswith("--"))) in said.replace(
        "--pdf, --details", "--details, --pdf"
    )
    assert "--code gb gives figures and no certificate; leave it out" in " ".join(said.split())


def test_after_a_step_of_the_grids_strength_an_underdamped_plant_comes_to_rest():
    bounds = e.strength_bounds(e.Swinging(20.0, 4.0, 0.5, 100 * math.pi), 0.3)(
        np.array([0.1, 0.5, 30.0])
    )
    assert (
        bounds.allowed[0]
        > bounds.allowed[1]
        > bounds.allowed[2]
        == pytest.approx(e.TUNNEL, abs=1e-3)
    )
    assert (bounds.asked <= bounds.ideal).all()
    assert (bounds.ideal <= bounds.allowed).all()
