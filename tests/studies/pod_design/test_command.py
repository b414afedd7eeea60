"""``gfor design`` as a user meets it: the sheet, the JSON, the parameter file, and what it says of bad input."""

import json
import re
import shlex
from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.cases.form.schema import NamedModeTable
from orchestrator.studies.coordinated_design import one_point
from orchestrator.studies.coordinated_design.one_point import design_controller
from orchestrator.studies.pod_design import design as module
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.pod_design.target import CRITICAL, find_target


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def design(gfor):
    def run(*arguments):
        code, out, err = gfor("design", "two_area", "--no-margins", *arguments)
        met = json.loads(out)["met"] if "--json" in arguments else out.startswith("met: ")
        assert code == (0 if met else 3), err
        assert (
            "closed loop with the design" in err.splitlines()
        )  # how far it is, off a terminal too
        warned = [line for line in err.splitlines() if line.startswith("warning")]
        # each test here asks several questions in one folder
        assert not [line for line in warned if "another design" not in line]
        return out

    return run


@pytest.mark.parametrize(
    ("controller", "T_S1", "T_S2"), [("pod_p", 0.20, 0.37), ("pod_q", 0.26, 0.29)]
)
def test_json_has_the_design(gfor, controller, T_S1, T_S2):
    idle = {"pod_p": "pod_q", "pod_q": "pod_p"}[controller]
    values = ("--set", "grid.X_L=0.1", "--set", f"gfor.{idle}.K=100")
    code, out, _ = gfor("design", "two_area", "--controller", controller, "--json", *values)
    assert code == 0
    d = json.loads(out)
    assert d["questions"] == [
        f"--set gfor.{idle}.K: gfor.{idle}.K cannot act: gfor.{idle}.enabled is false"
    ]
    assert list(d)[:10] == [
        "controller",
        "target_mode",
        "sensitivity",
        "T_S1",
        "T_S2",
        "N_S",
        "K",
        "K_unbounded",
        "predicted_mode",
        "achieved_mode",
    ]
    assert (d["controller"], d["N_S"], d["K"]) == (controller, 2, 200.0)
    assert d["T_S1"] == pytest.approx(T_S1, abs=0.01)
    assert d["T_S2"] == pytest.approx(T_S2, abs=0.01)
    target, aimed = (complex(d[k]["real"], d[k]["imag"]) for k in ("target_mode", "predicted_mode"))
    required = d["requirement"]["damping_ratio"]
    assert required == pytest.approx(0.1 - target.real / abs(target))
    assert aimed == pytest.approx(complex(-required * target.imag, target.imag))
    assert d["K_unbounded"] == pytest.approx(abs(aimed - target) / d["sensitivity"]["magnitude"])
    assert -180 < d["sensitivity"]["phase_deg"] <= 180
    assert d["met"] is True
    assert d["margins"]["gain_up"] is None or d["margins"]["gain_up"] > 1


def test_the_parameter_file_gives_the_mode_that_was_promised(gfor, design):
    achieved = json.loads(design("--controller", "pod_p", "--json"))["achieved_mode"]
    for command in (["--scenario", "gfor", "--parameters", "two_area_pod_p.toml"],):
        _, out, _ = gfor("modes", "two_area", "--json", *command)
        (mode,) = [
            m for m in json.loads(out)["scenarios"][0]["modes"] if m["name"] == "electromechanical"
        ]
        assert mode["real"] == pytest.approx(achieved["real"], abs=1e-5)
        assert mode["imag"] == pytest.approx(achieved["imag"], abs=1e-5)


def test_the_parameter_file_says_where_it_comes_from(design, tmp_path):
    design(
        "--controller",
        "pod_q",
        "--out",
        "new/mine.toml",
        "--set",
        "grid.X_L=0.2",
        "--damping",
        "30%",
    )
    file = read_parameter_file(tmp_path / "new" / "mine.toml")
    assert list(file.values) == [f"gfor.pod_q.{v}" for v in ("enabled", "K", "T_S1", "T_S2", "N_S")]
    assert file.values["gfor.pod_q.enabled"] is True
    (command,) = re.findall("^# command: (.*)$", file.text, re.MULTILINE)
    assert (
        command
        == "gfor design two_area --no-margins --controller pod_q --out new/mine.toml --set grid.X_L=0.2 --damping 30%"
    )


def test_a_report_takes_what_was_written_into_a_folder(design, gfor, tmp_path):
    """It was a file without a suffix, which a report refused."""
    design("--controller", "pod_q", "--out", "found")
    names = {path.name for path in (tmp_path / "found").iterdir()}
    assert names == {"two_area_pod_q.toml", "two_area_pod_q.json"}
    for place in ("found", "found/two_area_pod_q.toml"):
        code, out, _ = gfor("report", place, "--out", "page.html")
        assert (code, out.strip()) == (0, "page.html")
        assert "pod_q" in (tmp_path / "page.html").read_text("utf-8")
    (tmp_path / "taken").touch()
    code, _, err = gfor("design", "two_area", "--controller", "pod_q", "--out", "taken")
    assert code == 2
    assert "--out taken/two_area_pod_q.toml: the parameter file cannot be written there" in err


def test_a_pattern_that_fits_is_kept_in_the_parameter_file(design, tmp_path):
    design("--controller", "pod_q", "--component", "gfor*")
    assert '"gfor*.pod_q.K" = 200.0' in (tmp_path / "two_area_pod_q.toml").read_text()


def test_less_gain_with_more_damping_is_told_with_the_command_for_it(gfor, design):
    """The paper's bounds take K = 200 pu with a lag; 50 without one, tried on the way, damp by half as much again."""
    out = design("--controller", "pod_p").splitlines()[:3]
    (line,) = [text for text in out if text.startswith("less gain has more damping: K = 50 pu ")]
    assert "gives the target 36.17 %" in line
    words = shlex.split(line.partition(": gfor ")[2])
    code, said, _ = gfor(*words, "--json")
    (scenario,) = json.loads(said)["scenarios"]
    assert code == 0
    assert scenario["stability"]["stable"]
    least = min(scenario["modes"], key=lambda mode: mode["damping_percent"])
    assert (least["name"], round(least["damping_percent"], 2)) == ("electromechanical", 36.17)


def test_less_gain_is_not_told_where_more_was_tried(design):
    found = json.loads(design("--controller", "pod_p", "--delta-gain", "250", "--json"))
    assert found["less_gain"] is None


def test_the_sheet_shows_formulas_figures_and_units(design):
    out = design("--controller", "pod_p")
    for words in (
        "Ŝ_NC = (λ_NC − λ₀)/ΔK",
        "rad/s per pu ∠ -145.8",
        "lag",
        "T_S1 = 1/(ω₀√a)",
        "K ∈ [200, 400] pu",
        "200.00 pu (lower bound active)",
        "met: the target has 22.7",
    ):
        assert words in out.replace("-145.77", "-145.8")
    assert re.search(r"│ 1 +│ Target mode, POD off", out)


def test_the_sheet_says_why_a_requirement_is_not_met(design):
    out = design("--controller", "pod_p", "--set", "grid.X_L=0.01", "--gain-bounds", "200:400")
    assert out.startswith("not met: the target has 8.18 %")
    assert "K = 200 pu stands in the place of the equations' 400 pu" in " ".join(out.split())
    rows = [line for line in out.splitlines()[:8] if "Hz" in line and "%" in line and "│" in line]
    assert [row.split("│")[1].split(",")[0].strip() for row in rows] == ["as it is", "POD-P"]
    assert "1.020 Hz, 8.18 %" in rows[1]
    assert "with which the target has 7.39 %" in " ".join(out.split())
    assert "no gain from 200 to 400 pu has more than 8.18 %, at K = 200 pu" in out
    out = design("--controller", "pod_p", "--gain-bounds", "0:400")
    assert out.startswith("met: the target has 20.6")
    assert re.search(r"K = 6\d\.\d+ pu stands in the place of the equations' 18", out)
    out = design("--controller", "pod_p", "--gain-bounds", "0:400", "--refine")
    assert out.startswith("met: the target has 20.6")


def test_the_gain_can_come_from_the_sensitivity_with_the_lead_lag(design):
    options = ("--gain-from", "compensated", "--min-damping", "7", "--gain-bounds", "0:10000")
    d = json.loads(design("--controller", "pod_p", *options, "--json"))
    assert d["K_compensated"] != pytest.approx(d["K_non_compensated"], rel=0.01)
    assert d["K_of_equations"] == d["K_unbounded"] == d["K_compensated"]
    # the sweep found a better one
    assert d["achieved_damping_ratio"] > d["damping_ratio_of_equations"]
    assert d["requirement"]["least_damping_of_others"] == pytest.approx(0.07)


def test_no_stages_leave_the_lead_lag_out(design):
    d = json.loads(design("--controller", "pod_q", "--stages", "0", "--json"))
    assert (d["T_S1"], d["T_S2"], d["N_S"]) == (0, 0, 0)
    assert d["K_unbounded"] == pytest.approx(d["K_compensated"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            [],
            "no controller is given; give --controller, such as gfor design two_area --controller pod_p",
        ),
        (["--controller", "pod_x"], "invalid choice: 'pod_x'"),
        (["--scenario", "base"], "scenario 'base': no component has the controller pod_p"),
        (
            ["--scenario", "none"],
            "--scenario: there is no scenario 'none'; the case has: base, gfor",
        ),
        (
            ["--scenario", "gfr"],
            "--scenario: there is no scenario 'gfr'; did you mean gfor? the case has: base, gfor",
        ),
        (
            ["--scenario", "gfor", "--scenario", "pod_q"],
            "gfor design is for one scenario, not for gfor and pod_q",
        ),
        (
            ["--component", "sg*"],
            "--component sg*: scenario 'gfor' has no component of that name with pod_p; those",
        ),
        (["--mode", "1-2"], "--mode: the case names no mode '1-2'; it names: electromechanical"),
        (
            ["--damping", "5"],
            "--damping 5: without the controller the mode has 10.59 % already; ask for more",
        ),
        (["--damping", "120"], "'120' is not a damping in percent between 0 and 90, such as 20"),
        (
            ["--damping", "0.2"],
            "'0.2' is read in percent; write 20 for a ratio of 0.2, or 0.2% if so",
        ),
        (
            ["--damping", "20", "--damping-increment", "10"],
            "both say what is required; give one of them",
        ),
        (["--gain-bounds", "400:200"], "'400:200' are no bounds; write MIN:MAX in pu"),
        (
            ["--gain-bounds", "0:1e6"],
            "--gain-bounds: 1e+06 is out of range: gfor.pod_p.K takes from 0 to 100000",
        ),
        (["--delta-gain", "0"], "'0' must be a number above 0"),
        (["--stages", "4"], "--stages: 4 is out of range: gfor.pod_p.N_S takes from 0 to 3"),
        (
            ["--set", "gfor.pod_p.T_X=1"],
            "--set gfor.pod_p.T_X: component 'gfor' has no variable 'pod_p.T_X'",
        ),
        (["--parameters", "none.toml"], "none.toml: the parameter file cannot be read"),
    ],
)
def test_input_that_cannot_be_used(gfor, tmp_path, arguments, words):
    controller = [] if not arguments or "--controller" in arguments else ["--controller", "pod_p"]
    code, out, err = gfor("design", "two_area", *controller, *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("error:") == 1
    assert not list(tmp_path.iterdir())


def test_too_few_stages(gfor):
    code, _, err = gfor(
        "design",
        "two_area",
        "--controller",
        "pod_q",
        "--set",
        "gfor.pod_q.T_W=0.02",
        "--stages",
        "1",
    )
    assert code == 1
    assert "ask for 2 stages with --stages" in err


def test_a_tie_of_two_modes_is_no_target(gfor):
    """At this reactance two modes fit the name, and no gain leads here from where one does."""
    code, _, err = gfor("design", "two_area", "--controller", "pod_q", "--set", "grid.X_L=0.7")
    assert code == 2
    assert "no mode is named 'electromechanical': the mode of 0.582 Hz, 10.59 %" in err
    assert "meets another one 50 % of the way from there, at 0.276 Hz, 37.35 %" in err


def test_the_least_damped_swing_is_the_target_though_another_mode_fits_its_own_rule_better(
    monkeypatch, tmp_path
):
    """Planted: in a case without names, a rule for the least damped swing that fits the converter's mode."""
    text = re.sub(r"(?m)^modes = .*$", "modes = []", load_case("two_area").text)
    text = re.sub(r"(?ms)^\[reference\]$.*?(?=^\[(?!reference))", "", text)
    (tmp_path / "unnamed.toml").write_text(text, encoding="utf-8")
    tables = []

    def planted(table, modes):
        tables.append(modes)
        rule = NamedModeTable(name=CRITICAL, states=["gfor.*"])
        analysis = table.analysis.model_copy(update={"modes": [rule]})
        return table.model_copy(update={"analysis": analysis})

    monkeypatch.setattr(module, "naming_critical", planted)
    request = DesignRequest("pod_p", margins=False)
    found = design_controller(load_case(tmp_path / "unnamed.toml"), request).result
    assert found.initial == pytest.approx(tables[0][0].eigenvalue)
    assert found.before.other_named is None
    assert found.met


def test_a_case_whose_scenarios_leave_it_open(gfor, tmp_path):
    text = load_case("two_area").text.replace(
        'title = "SG + GFOR"', 'title = "SG + GFOR"\n[scenarios.second]'
    )
    (tmp_path / "open.toml").write_text(text, encoding="utf-8")
    code, _, err = gfor("design", "open.toml", "--controller", "pod_p")
    assert code == 2
    assert (
        "more than one scenario (gfor, second) has components with pod_p and every POD off" in err
    )
    assert "name one with --scenario" in err
    text = text.replace("[scenarios.second]", "[scenarios.second]\nevents = []")
    (tmp_path / "open.toml").write_text(text, encoding="utf-8")
    chosen = find_target(
        load_case(tmp_path / "open.toml"),
        "pod_p",
        scenario=None,
        pattern=None,
        stages=None,
        overrides={},
        parameters=(),
    )
    assert chosen.scenario == "gfor"


UNSTABLE = ("--set", "sg1.exciter.K_IR=100")


def test_a_design_that_ends_early_says_that_the_system_is_unstable(gfor, tmp_path):
    text = load_case("two_area_rms").text
    same = 'against = [["sg1.machine.omega"], ["sg1.machine.omega"]]'
    (tmp_path / "early.toml").write_text(
        text.replace('states = ["sg?.machine.omega", "sg?.machine.delta"]', same), encoding="utf-8"
    )
    for values, unstable in ((UNSTABLE, True), ((), False)):
        code, _, err = gfor(
            "design", "early.toml", "--controller", "pod_p", "--scenario", "gfor", *values
        )
        assert code == 2
        assert "shows no mode 'electromechanical'" in err
        assert ("Without the controller the system is UNSTABLE: a mode grows at" in err) == unstable


def test_the_largest_real_part_is_the_headlines_and_the_other_mode_another(gfor):
    arguments = ("design", "two_area_rms", "--controller", "pod_p", "--no-margins")
    _, out, _ = gfor(*arguments)
    figures = re.findall(r"the largest real part of all \d+ eigenvalues is (\S+) 1/s", out)
    (row,) = [line for line in out.splitlines() if "Largest real part of all" in line]
    assert re.findall(r"(\S+) 1/s", row) == figures
    _, out, _ = gfor(*arguments, "--json")
    d = json.loads(out)
    assert d["largest_real_part"]["after"] == d["largest_growth_rate"] < 0
    assert d["achieved_mode"] != d["followed_mode"]  # two modes have traded places
    assert d["worst_other_mode"]["after"]["real"] != pytest.approx(d["achieved_mode"]["real"])
    assert d["worst_other_mode"]["after"]["damping_ratio"] >= d["achieved_damping_ratio"]


def test_gains_that_were_unstable_are_marked(gfor, monkeypatch):
    """In the sweep of the gain alone: what a search finds besides is another test's subject."""
    monkeypatch.setattr(one_point, "search_settings", lambda *_: [])
    arguments = (
        "design",
        "two_area_rms",
        "--controller",
        "pod_p",
        "--no-margins",
        "--refine",
        *UNSTABLE,
    )
    _, out, _ = gfor(*arguments, "--gain-bounds", "0:50", "--damping-increment", "1")
    assert "† the system is unstable with this gain" in out
    (sweep,) = re.findall(r"as designed .*", out)
    assert "†" in sweep
    content = json.loads((Path("two_area_rms_pod_p.json")).read_text(encoding="utf-8"))
    assert 0.0 in content["refinement"]["sweeps"][0]["unstable_gains"]


def test_a_design_that_is_not_met_leaves_the_file_of_one_that_is(gfor, design, tmp_path):
    """A command typed again with other bounds took the file that its first answer names."""
    design("--controller", "pod_p")
    kept = (tmp_path / "two_area_pod_p.toml").read_text("utf-8")
    few = ("--controller", "pod_p", "--no-margins", "--gain-bounds", "1:2", "--json")
    code, out, err = gfor("design", "two_area", *few)
    assert (code, json.loads(out)["parameter_file"]) == (3, "two_area_pod_p_not_met.toml")
    assert "two_area_pod_p.toml stays as it was, with another design" in " ".join(err.split())
    assert (tmp_path / "two_area_pod_p.toml").read_text("utf-8") == kept
    assert read_parameter_file(tmp_path / "two_area_pod_p_not_met.toml").values["gfor.pod_p.K"] <= 2
