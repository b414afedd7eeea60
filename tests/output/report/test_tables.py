"""What terminal, report and pages show, cell by cell against the figures that programs read."""

import csv
import json
import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from orchestrator.face.cli import main
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.output.report.short_texts import kinds_of
from tests.support.once import made_once
from tests.support.printed import eigenvalue, in_markdown, on_page, on_terminal, value

SCENARIOS = ["--scenario", "base", "--scenario", "pod_p"]
ROOT = Path(__file__).parents[3]
VALIDATION = ROOT / ".docs" / "validation"

pytestmark = pytest.mark.usefixtures("undrawn")


def printed_by(*words):
    """What a command printed that ended well."""
    printed = StringIO()
    with redirect_stdout(printed):
        assert main([*map(str, words)]) == 0
    return printed.getvalue()


def run_once(name, *words, report=False):
    """A run of two scenarios: its folder, and what it printed; the report of all in the folder where it is wanted."""

    def run(place):
        command = ["run", "two_area", *SCENARIOS, "--workers", "1", *words]
        (place / "printed.txt").write_text(printed_by(*command, "--out", place / "run"), "utf-8")
        if report:
            printed_by("report", place / "run")

    place = made_once(name, run)
    return place / "run", (place / "printed.txt").read_text("utf-8")


@pytest.fixture(scope="module")
def studied():
    return run_once("tables", "--stop", "5", report=True)


@pytest.fixture(scope="module")
def summary(studied):
    scenarios = json.loads((studied[0] / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert len(scenarios) == 2
    return {s["title"]: s for s in scenarios}


@pytest.fixture(scope="module")
def printed(studied):
    return on_terminal(studied[1])


@pytest.fixture(scope="module")
def page(studied):
    return on_page((studied[0] / "report.html").read_text(encoding="utf-8"))


def table(tables, *words):
    """The one table whose title has these words."""
    (found,) = [rows for title, rows in tables.items() if all(word in title for word in words)]
    return found


def agrees(row, heading, wanted):
    """A cell has the number, in the digits that it shows."""
    cell = row[heading]
    digits = len(cell.partition(".")[2].rstrip("% "))
    assert value(cell) == pytest.approx(wanted, abs=0.5 * 10**-digits * (1 + 1e-9)), (heading, row)


# -- the terminal -------------------------------------------------------------------------------


def test_the_terminals_modes(studied, printed, summary):
    """The answer has the mode's figures, the paper's in brackets; no other table says them again."""
    assert not [title for title in printed if "Electromechanical mode" in title]
    answers = on_terminal("\n" + studied[1])[""]
    shapes = table(printed, "Mode shapes")
    assert [row["Scenario"] for row in shapes] == [row["Scenario"] for row in answers]
    assert [row["Scenario"] for row in answers] == list(summary)
    for answer, shape in zip(answers, shapes, strict=True):
        row = {**answer, **shape}
        s = summary[row["Scenario"]]
        mode, theirs = s["modes"]["electromechanical"], s["references"]["electromechanical"]
        assert eigenvalue(row["Mode [rad/s]"]) == pytest.approx(
            complex(mode["real"], mode["imag"]), abs=1e-4
        )
        for heading, key in (("f [Hz]", "frequency_hz"), ("Damping [%]", "damping_percent")):
            ours, others = row[f"{heading} (paper)"].rstrip(")").split(" (")
            agrees({heading: ours}, heading, mode[key])
            agrees({heading: others}, heading, theirs[key])


def test_one_line_tells_how_a_run_was_computed(studied, summary):
    """The worst of all scenarios, with the remedy that shows the tables."""
    (line,) = [line for line in studied[1].splitlines() if line.startswith("How it was computed")]
    residual = float(re.search(r"hold to (\S+) in", line)[1])
    assert residual == pytest.approx(max(s["residual"] for s in summary.values()), rel=0.06)
    moved = float(re.search(r"mode by (\S+) rad/s", line)[1])
    rows = csv.DictReader((studied[0] / "step_size.csv").read_text(encoding="utf-8").splitlines())
    shifts = [
        float(row["shift [rad/s]"])
        for row in rows
        if row["schedule"] == "gauss-seidel" and float(row["step size [s]"]) == 1e-4
    ]
    assert len(shifts) == len(summary)
    assert moved == pytest.approx(max(shifts), rel=0.06)
    assert line.endswith("--details has the tables.")


@pytest.fixture(scope="module")
def detailed():
    """A short run of the same scenarios with details: its folder, and its tables."""
    folder, printed = run_once("details", "--stop", "1", "--details", "--no-csv")
    assert "How it was computed" not in printed
    return folder, on_terminal(printed)


def test_the_details_of_a_run_have_its_steady_state(detailed):
    folder, tables = detailed
    scenarios = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    summary = {s["title"]: s for s in scenarios}
    assert table(tables, "Run")
    rows = table(tables, "Steady state")
    assert [row["Scenario"] for row in rows] == list(summary)
    for row in rows:
        s = summary[row["Scenario"]]
        assert int(row["States"]) == s["states"]
        assert value(row["Residual per step"]) == pytest.approx(s["residual"], rel=0.06)
        assert value(row["Power-flow residual [pu]"]) == pytest.approx(
            s["power_flow"]["residual"], rel=0.06
        )


def test_the_terminals_ring_down(printed, summary):
    rows = table(printed, "Ring-down")
    assert [row["Scenario"] for row in rows] == list(summary)
    for row in rows:
        s = summary[row["Scenario"]]
        agrees(row, "f simulated [Hz]", s["ring_down"]["frequency_hz"])
        agrees(row, "Damping simulated [%]", s["ring_down"]["damping_percent"])
        agrees(row, "f mode [Hz]", s["modes"]["electromechanical"]["frequency_hz"])
        agrees(row, "Damping mode [%]", s["modes"]["electromechanical"]["damping_percent"])
        # else they could change places
        assert abs(value(row["f simulated [Hz]"]) - value(row["f mode [Hz]"])) > 1e-4


def shifts(folder):
    with (folder / "step_size.csv").open(encoding="utf-8") as file:
        return {
            (r["scenario"], r["schedule"], f"{1e6 * float(r['step size [s]']):g} µs"): r
            for r in csv.DictReader(file)
        }


@pytest.mark.parametrize("where", ["details", "page"])
def test_the_shift_by_the_communication_step(where, request, summary):
    folder, tables = request.getfixturevalue("studied" if where == "page" else "detailed")
    if where == "page":
        tables = request.getfixturevalue("page")
    rows, known = table(tables, "How far each communication step", "[rad/s]"), shifts(folder)
    cells = 0
    for row in rows:
        name = summary[row["Scenario"]]["name"]
        for heading, cell in row.items():
            if heading.endswith("µs"):
                entry = known[name, row["Schedule"], heading]
                there = complex(float(entry["real [1/s]"]), float(entry["imag [rad/s]"]))
                exact = complex(
                    float(entry["continuous real [1/s]"]), float(entry["continuous imag [rad/s]"])
                )
                assert value(cell) == pytest.approx(float(entry["shift [rad/s]"]), rel=0.06)
                assert value(cell) == pytest.approx(abs(there - exact), rel=0.06)
                cells += 1
    assert cells == len(known) >= 16


def swings_apart(modes):
    """The modes in which machines swing, and the others."""
    swings, others = [], []
    for mode in modes:
        leading = [entry["state"] for entry in mode["participation"][:3]]
        (swings if any(s.endswith("machine.omega") for s in leading) else others).append(mode)
    return swings, others


def test_the_terminal_shows_swings_and_counts_what_is_well_damped(gfor):
    arguments = ["modes", "two_area", "--scenario", "pod_p", "--range", "0.1:60"]
    _, out, _ = gfor(*arguments)
    (scenario,) = json.loads(gfor(*arguments, "--json")[1])["scenarios"]
    swings, others = swings_apart(scenario["modes"])
    rows = [row for row in table(on_terminal(out), "62 states") if row["f [Hz]"]]
    shown = [value(row["Damping [%]"]) for row in rows]
    weak = [mode["damping_percent"] for mode in others if mode["damping_percent"] < 30]
    assert shown == pytest.approx([*(m["damping_percent"] for m in swings), *weak], abs=0.005)
    assert min(shown[len(swings) :]) < 1, "a weakly damped mode of the network is not left out"
    hidden = len(others) - len(weak)
    assert re.search(rf"and {hidden} modes of controls and fluxes, damped by \d\d % or more", out)


def test_the_terminals_table_of_all_modes(gfor):
    arguments = ["modes", "two_area", "--scenario", "pod_p", "--range", "0.1:60"]
    code, out, _ = gfor(*arguments, "--details")
    assert code == 0
    (scenario,) = json.loads(gfor(*arguments, "--json")[1])["scenarios"]
    rows = table(on_terminal(out), "62 states")
    # A row goes on in the next line where the cell of participations is folded: that line has no mode.
    rows = [row for row in rows if row["f [Hz]"]]
    assert len(rows) == len(scenario["modes"]) >= 8
    swings, others = swings_apart(scenario["modes"])
    for row, mode in zip(rows, [*swings, *others], strict=True):
        assert eigenvalue(row["Mode [rad/s]"]) == pytest.approx(
            complex(mode["real"], mode["imag"]), abs=1e-4
        )
        agrees(row, "f [Hz]", mode["frequency_hz"])
        agrees(row, "Damping [%]", mode["damping_percent"])
        assert row["Name"] == (mode["name"] or "")
        first = mode["participation"][0]
        assert row["Most associated states (participation)"].startswith(
            f"{first['state']} ({first['factor']:.2f})"
        )


def test_the_terminals_mode_shapes(gfor):
    arguments = ["modes", "two_area", *SCENARIOS]
    rows = table(on_terminal(gfor(*arguments)[1]), "Mode shapes")
    scenarios = {s["name"]: s for s in json.loads(gfor(*arguments, "--json")[1])["scenarios"]}
    for row, scenario in zip(rows, ("base", "pod_p"), strict=True):
        (mode,) = [m for m in scenarios[scenario]["modes"] if m["name"]]
        for heading, of in (("Participation by component", "components"), ("By area", "areas")):
            shown = dict(re.findall(r"(\S+) (\d+)%", row[heading]))
            assert shown
            for name, share in shown.items():
                assert int(share) == pytest.approx(100 * mode[of][name], abs=0.5)
        turned = {entry["state"].split(".")[0]: entry["angle_deg"] for entry in mode["shape"]}
        other, *angle = (row["Against"] or row["In between"]).split()
        apart = (turned[other] - turned[row["Swing together"]] + 180) % 360 - 180
        if angle:
            assert float(angle[0].rstrip("°")) == pytest.approx(apart, abs=0.5)
            assert 45 < abs(apart) < 135
        else:
            assert abs(apart) >= 135


# -- the page -----------------------------------------------------------------------------------


def test_the_pages_modes(page, summary):
    rows = table(page, "Electromechanical mode")
    names = [row["Scenario"].partition(": ") for row in rows]
    assert [title for _, _, title in names] == list(summary)
    for row, (name, _, title) in zip(rows, names, strict=True):
        mode, theirs = summary[title]["modes"][name], summary[title]["references"][name]
        assert eigenvalue(row["Mode [rad/s]"]) == pytest.approx(
            complex(mode["real"], mode["imag"]), abs=1e-4
        )
        agrees(row, "f [Hz]", mode["frequency_hz"])
        agrees(row, "Damping [%]", mode["damping_percent"])
        agrees(row, "paper: f [Hz]", theirs["frequency_hz"])
        agrees(row, "Damping [%] 2", theirs["damping_percent"])


def test_what_is_poorly_damped_is_marked(studied, page):
    text = (studied[0] / "report.html").read_text(encoding="utf-8")
    marked = re.findall(r'<td><span class="bad">([^<]*)</span></td>', text)
    assert "−0.90" in marked
    assert not [cell for cell in marked if value(cell) >= 5]


def test_the_first_box_has_the_verdict_and_the_least_damped_mode(page, summary):
    rows = table(page, "Verdicts")
    assert [row["Scenario"] for row in rows] == list(summary)
    for row in rows:
        s = summary[row["Scenario"]]
        assert row["Verdict"] == s["answer"]["verdict"]
        hertz, _, percent = row["Least damped"].partition(" Hz, ")
        figures = {"f": hertz, "damping": percent.removesuffix(" %")}
        agrees(figures, "f", s["answer"]["frequency_hz"])
        agrees(figures, "damping", s["answer"]["damping_percent"])


def test_the_pages_ring_down(page, summary):
    rows = table(page, "Ring-down")
    assert [row["Scenario"] for row in rows] == list(summary)
    for row in rows:
        s = summary[row["Scenario"]]
        agrees(row, "f simulated [Hz]", s["ring_down"]["frequency_hz"])
        agrees(row, "Damping simulated [%]", s["ring_down"]["damping_percent"])
        agrees(row, "f mode [Hz]", s["modes"]["electromechanical"]["frequency_hz"])
        agrees(row, "Damping mode [%]", s["modes"]["electromechanical"]["damping_percent"])


def test_the_pages_operating_point(page, summary):
    flows = {title: s["power_flow"] for title, s in summary.items()}
    for row in table(page, "Coupled steady state"):
        voltages = [v for v, _ in flows[row["Scenario"]]["buses"].values()]
        agrees(row, "Lowest voltage [pu]", min(voltages))
        agrees(row, "Highest [pu]", max(voltages))
    units = [(name, unit) for flow in flows.values() for name, unit in flow["units"].items()]
    for row, (name, unit) in zip(table(page, "Units"), units, strict=True):
        assert row["Unit"] == name
        agrees(row, "Rating [MVA]", unit["rating_mva"])
        agrees(row, "P [MW]", unit["p_mw"])
        agrees(row, "Q [Mvar]", unit["q_mvar"])
    buses = [(name, *bus) for flow in flows.values() for name, bus in flow["buses"].items()]
    for row, (name, v, angle) in zip(table(page, "Buses"), buses, strict=True):
        assert row["Bus"] == name
        agrees(row, "Voltage [pu]", v)
        agrees(row, "Angle [°]", angle)


def test_the_file_of_modes_has_the_summarys_figures(studied, summary):
    with (studied[0] / "modes.csv").open(encoding="utf-8") as file:
        rows = {r["scenario"]: r for r in csv.DictReader(file) if r["name"] == "electromechanical"}
    for s in summary.values():
        mode, row = s["modes"]["electromechanical"], rows[s["name"]]
        for heading, key in {
            "real [1/s]": "real",
            "imag [rad/s]": "imag",
            "frequency [Hz]": "frequency_hz",
            "damping [%]": "damping_percent",
        }.items():
            assert float(row[heading]) == pytest.approx(mode[key], rel=1e-5), heading


# -- README and pages of validation ----------------------------------------------------------------

NAMES = {
    "Base (only SG)": "base",
    "SG + GFOR": "gfor",
    "POD-P": "pod_p",
    "POD-Q": "pod_q",
    "POD-PQ": "pod_pq",
}


def on_page_of(name):
    """Tables of a page of validation."""
    return in_markdown((VALIDATION / f"{name}.md").read_text(encoding="utf-8"))


def test_the_readme_shows_the_page_of_validations_figures():
    """The paper's and our values without saturation, row by row."""
    (short,) = [
        t
        for t in in_markdown((ROOT / "README.md").read_text(encoding="utf-8"))
        if "here: λ" in str(t[0])
    ]
    (rows,) = [t for t in on_page_of("two-area") if "no saturation (default)" in t[0]]
    assert short[1:] == [row[:5] for row in rows[2:]]


@pytest.mark.parametrize(("saturated", "first"), [(False, 3), (True, 5)])
def test_the_table_of_the_paper(gfor, saturated, first):
    """λ and ξ of all scenarios, in the columns without and with saturation."""
    (rows,) = [t for t in on_page_of("two-area") if "no saturation (default)" in t[0]]
    on = [f"--set={unit}.machine.saturation=true" for unit in ("sg1", "sg2")] if saturated else []
    code, out, _ = gfor("modes", "two_area", *on, "--json")
    assert code == 0
    found = {
        s["name"]: next(m for m in s["modes"] if m["name"]) for s in json.loads(out)["scenarios"]
    }
    assert [row[0] for row in rows[2:]] == list(NAMES)
    for name, *_ in rows[2:]:
        (row,) = [r for r in rows if r[0] == name]
        mode = found[NAMES[name]]
        assert eigenvalue(row[first]) == pytest.approx(
            complex(mode["real"], mode["imag"]), abs=0.7e-3
        )
        assert value(row[first + 1]) == pytest.approx(mode["damping_percent"], abs=0.5e-2 * 1.001)


def test_the_table_of_steps(studied):
    """|Δλ| in 10⁻³ rad/s; the rows of the base case, which is run here."""
    (rows,) = [t for t in on_page_of("two-area") if t[0][:2] == ["Scenario", "Schedule"]]
    known = shifts(studied[0])
    base = next(k for k, row in enumerate(rows) if row[0] == "Base")
    for row, schedule in zip(rows[base : base + 2], ("gauss-seidel", "jacobi"), strict=True):
        for heading, cell in list(zip(rows[0], row, strict=True))[2:]:
            shift = 1e3 * float(known["base", schedule, heading]["shift [rad/s]"])
            assert value(cell) == pytest.approx(shift, rel=0.03), (row, heading)


@pytest.mark.slow
@pytest.mark.parametrize(
    "label", ["POD-P, ΔK = 50", "POD-Q, ΔK = 50", "POD-P, ΔK = 0.1", "POD-Q, ΔK = 0.1"]
)
def test_the_table_of_designs(gfor, label, tmp_path):
    (rows,) = [t for t in on_page_of("pod-design") if "K before its bounds" in t[0]]
    (row,) = [r for r in rows if r[0] == label]
    controller, gain = label.split(", ΔK = ")
    out = ("--out", tmp_path / "pod.toml")
    arguments = [
        "--controller",
        NAMES[controller],
        "--delta-gain",
        gain,
        "--no-margins",
        "--json",
        *out,
    ]
    found = json.loads(gfor("design", "two_area", *arguments)[1])
    for heading, key in {
        "T_S1 [s]": "T_S1",
        "T_S2 [s]": "T_S2",
        "K before its bounds": "K_unbounded",
    }.items():
        agrees(dict(zip(rows[0], row, strict=True)), heading, found[key])


@pytest.mark.parametrize("names", [["01", "2"], ["2026-02-30 00:00:00"], ["usual", "1"]])
def test_names_of_points_that_are_no_numbers_and_no_times_stay(names):
    columns = (Column("Point", lambda name: name, name="point"),)
    assert ColumnTable("", columns, names).frame()["point"].tolist() == names
    times = ["2026-01-01 00:00:00", "2026-01-01 01:00:00"]
    assert [*map(str, ColumnTable("", columns, times).frame()["point"])] == times
    assert ColumnTable("", columns, times).frame()["point"].dt.hour.tolist() == [0, 1]


def test_a_reason_behind_figures_stands_at_the_left_of_its_column_on_a_page():
    columns = [
        Column[tuple[str, float, str]]("Outage", lambda row: row[0]),
        Column[tuple[str, float, str]]("Damping [%]", lambda row: row[1], ".1f"),
        Column[tuple[str, float, str]]("Why not", lambda row: row[2], text=True),
    ]
    page = ColumnTable("Outages", columns, [("l1", 6.0, "no way leads to b1")]).html()
    assert re.findall(r"<t[dh] class=text>(.*?)<", page) == [
        "Outage",
        "Why not",
        "l1",
        "no way leads to b1",
    ]
    assert "<td>6.0</td>" in page


def test_texts_that_differ_in_figures_only_are_one_kind_and_names_are_not_figures():
    said = [
        ("a", ["bus_1 feeds 70 Mvar", "bus_2 feeds 1 Mvar"]),
        ("b", ["bus_1 feeds -7.5e1 Mvar"]),
    ]
    assert kinds_of(said) == [("bus_1 feeds 70 Mvar", ["a", "b"]), ("bus_2 feeds 1 Mvar", ["a"])]
