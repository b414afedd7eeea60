"""`gfor fmu bind`, `gfor fmu check`, and a vendor's FMU in a case, as a user meets them."""

import ast
import json
import shutil
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
import xarray as xr

from orchestrator import load
from orchestrator.cases.built_in import infinite_bus, two_area
from orchestrator.cases.case import load_case
from orchestrator.cases.use import use_in_case
from orchestrator.core.errors import CaseError
from orchestrator.core.foreign_files import one_line
from orchestrator.devices.acceptance.checks.all import CHECKS, ORDER
from orchestrator.devices.acceptance.checks.own import MODULES
from orchestrator.devices.acceptance.checks.own import ORDER as OWN
from orchestrator.devices.acceptance.checks.subject import OperatingAt
from orchestrator.devices.sandbox.protections_in_force import NAMES
from orchestrator.studies.sweep.axes import parse_vary
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.hostile import entities
from tests.devices.acceptance.gallery.members import converter

pytestmark = pytest.mark.usefixtures("undrawn")

FAST = ("--only", "power_balance", "--time-limit", "10")


@pytest.fixture
def case(tmp_path):
    """The two-area case with a vendor's FMU in place of our converter."""

    def write(fmu, binding=None, extra=""):
        text = (Path(two_area.__file__).parent / "case.toml").read_text(encoding="utf-8")
        ours = 'model = "gfor"\n'
        assert text.count(ours) == 1
        bound = f'binding = "{binding}"\n' if binding else ""
        text = text.replace(ours, f'fmu = "{fmu}"\n{bound}{extra}')
        head, tail = (
            text.partition("[scenarios.base]")[0],
            text.partition("[analysis]")[2].partition("[reference]")[0],
        )
        path = tmp_path / "case.toml"
        path.write_text(f"{head}[scenarios.vendor]\n[analysis]{tail}", encoding="utf-8")
        return path

    return write


def test_every_check_has_its_place_in_the_order():
    assert MODULES
    assert ORDER[: len(OWN)] == OWN
    assert set(ORDER) == set(CHECKS)
    for name, check in CHECKS.items():
        assert all(ORDER.index(needed) < ORDER.index(name) for needed in check.needs)


RESULTS = ("passed", "failed", "remarked", "not_applicable", "not_supported", "provoked")


def test_every_result_stands_under_the_name_of_a_check():
    """Where the reason stood in its place, a table would have a row that no check has and `--only` cannot ask for."""
    folder, named = Path(MODULES[0].__file__).parent, []
    for path in sorted(folder.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in RESULTS:
                first = node.args[0]
                if isinstance(first, ast.Constant | ast.JoinedStr):
                    named.append((getattr(first, "value", ""), f"{path.name}, line {node.lineno}"))
    assert len(named) > 100
    assert [where for name, where in named if name not in CHECKS] == []


def test_a_draft_tells_what_is_left_to_fill_in(gfor, gallery, tmp_path):
    fmu, _ = gallery("converter_qd_si")
    out = tmp_path / "vendor.toml"
    code, text, _ = gfor("fmu", "bind", fmu, "--out", out)
    assert code == 0
    assert "to be filled in: S_n" not in text  # its S_n has a start value
    assert text.count("to be filled in: value") == 3
    assert "to be filled in: V_n" in text  # its port is in kV and kA
    code, _, error = gfor("fmu", "bind", fmu, "--out", out)
    assert code == 2
    assert "there already" in error
    assert gfor("fmu", "bind", fmu, "--out", out, "--force")[0] == 0
    code, _, error = gfor("fmu", "check", fmu, "--binding", out, *FAST)
    assert code == 2
    assert "still to be filled in" in error


def test_a_sound_fmu_ends_with_0(gfor, gallery):
    code, text, _ = gfor("fmu", "check", *_bound(gallery("converter_qd_si")), *FAST)
    assert code == 0
    *_, counts, verdict = text.splitlines()
    assert "no check failed" in verdict
    passed = sum(line.startswith("pass  ") for line in text.splitlines())
    assert f"pass {passed}" in counts.removesuffix(".").split(", ")
    assert "S is what is asked" in text


def test_a_faulty_one_ends_with_1_and_says_what_to_do(gfor, gallery, tmp_path):
    junit = tmp_path / "out.xml"
    code, text, _ = gfor("fmu", "check", gallery("sign")[0], *FAST, "--json", "--junit", junit)
    assert code == 1
    report = json.loads(text)
    assert report["faults"] == ["wrong sign"]
    assert not report["trusted"]
    failure = report["checks"][-1]
    assert failure["check"] == "power_balance"
    assert failure["figures"]["a"] == pytest.approx([-1, 0], abs=1e-9)
    assert "direction" in failure["remedy"]
    suite = ElementTree.parse(junit).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert suite.find("testcase/failure").get("message") == "wrong sign"


def test_one_cause_is_told_once(gfor, gallery):
    """A step that is discarded at 0.3 s ends three checks; what to do about it stands once as well."""
    code, text, _ = gfor(
        "fmu",
        "check",
        gallery("discards")[0],
        "--only",
        "loads",
        "--only",
        "runs",
        "--only",
        "steady_state",
    )
    assert code == 1
    assert text.count("fmi2DoStep returned fmi2Discard") == 1
    assert "error in a step: the same as in 'runs'" in text
    (line,) = [number for number, words in enumerate(text.splitlines()) if "fmi2Discard" in words]
    remedy = text.splitlines()[line + 1].strip()
    assert text.count(remedy) == 1


def test_a_hostile_file_is_a_finding_and_not_an_accident(gfor, gallery, tmp_path):
    code, text, _ = gfor("fmu", "check", entities(tmp_path, gallery("gain")[0]))
    assert code == 1
    assert "entity expansion" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("none.fmu",), "there is no such file"),
        (
            ("FMU", "--only", "nothing"),
            "there is no check 'nothing'; there are: archive, binding, fmi_validity",
        ),
        (("FMU", "--binding", "none.toml"), "`gfor fmu bind FILE.fmu` drafts one"),
        (("FMU", "--time-limit", "-1"), "must be a number above 0"),
    ],
)
def test_what_cannot_be_used(arguments, words, gfor, gallery):
    code, out, error = gfor(
        "fmu", "check", *[gallery("gain")[0] if a == "FMU" else a for a in arguments]
    )
    assert code == 2
    assert out == ""
    assert words in error


@pytest.mark.parametrize(
    ("fmu", "step", "verdict", "words"),
    [
        ("held", "1e-4", "fail", "every 1 ms only"),
        ("held", "1e-3", "pass", "every 1 ms only; with steps of 1 ms that is every step"),
        (
            "van_der_pol",
            "0.007",
            "remark",
            "every 10 ms only: 30 % of all steps of 7 ms do nothing",
        ),
    ],
)
def test_a_check_at_the_step_of_use(fmu, step, verdict, words, gfor, gallery):
    """Of the last one, an own step of 10 ms, every third step does nothing at 7 ms, and runs agree at common times."""
    code, text, _ = gfor(
        "fmu", "check", gallery(fmu)[0], "--only", "sample_time", "--step", step, "--json"
    )
    result = json.loads(text)["checks"][-1]
    assert code == (verdict == "fail")
    assert result["verdict"] == verdict
    assert words in result["evidence"]


def test_a_check_as_a_case_uses_it(gfor, gallery, case):
    """Step, operating point, values and binding are the case's."""
    fmu, binding = gallery("converter_qd_si")
    path = case(fmu, binding)
    use, found = use_in_case(str(path), None, fmu, None)
    assert (use.step_size, use.point.P) == (1e-4, pytest.approx(0.9))
    assert use.values["S_n"] > 0
    assert found.samefile(binding)
    code, text, error = gfor(
        "fmu", "check", fmu, "--case", path, "--only", "power_balance", "--json"
    )
    assert code == 0, error
    assert "at 8 points" in json.loads(text)["checks"][-1]["evidence"]
    code, _, error = gfor("fmu", "check", gallery("gain")[0], "--case", path)
    assert code == 2
    assert (
        "no component is gain.fmu; say which one it is with --component (components that are FMUs: gfor)"
        in error
    )
    code, _, error = gfor("fmu", "check", fmu, "--component", "gfor")
    assert code == 2
    assert "give case as well" in error


def test_the_first_scenario_that_has_the_component_is_used(gfor, gallery, case):
    fmu, _ = gallery("converter")
    path = case(fmu)
    text = path.read_text(encoding="utf-8")
    bare = '[scenarios.bare]\nremove = ["gfor"]\n'
    path.write_text(
        text.replace("[scenarios.vendor]", f"{bare}[scenarios.vendor]"), encoding="utf-8"
    )
    code, out, error = gfor("fmu", "check", fmu, "--case", path, "--only", "units")
    assert code == 0, error
    assert "As component 'gfor' in scenario 'vendor' of case.toml: P_0 = 0.9, " in out
    code, _, error = gfor("fmu", "check", fmu, "--case", path, "--scenario", "bare")
    assert code == 2
    assert "scenario 'bare' removes component 'gfor'; scenarios that have it: vendor" in error
    code, _, error = gfor("fmu", "check", fmu, "--case", path, "--scenario", "other")
    assert "there is no scenario 'other'; scenarios with 'gfor': vendor" in error
    path.write_text(text.replace("[scenarios.vendor]", bare), encoding="utf-8")
    code, _, error = gfor("fmu", "check", fmu, "--case", path)
    assert code == 2
    assert "every scenario removes component 'gfor'" in error


def test_a_start_value_that_a_case_does_not_give_has_its_default(gallery, tmp_path):
    """A case without a power flow gives P_0, Q_0 and v_0, and no angle."""
    fmu, _ = gallery("converter")
    text = (Path(infinite_bus.__file__).parent / "case.toml").read_text(encoding="utf-8")
    path = tmp_path / "case.toml"
    path.write_text(text.replace('model = "gfor"\n', f'fmu = "{fmu}"\n'), encoding="utf-8")
    use, _ = use_in_case(str(path), None, fmu, None)
    assert use.point == OperatingAt(1.0, 0.0, 0.6, 0.05)
    assert use.said.endswith("P_0 = 0.6, Q_0 = 0.05, v_0 = 1, theta_0 = 0 (default)")


def test_what_an_fmu_says_stays_in_its_line():
    """An FMU could write a verdict of its own on the terminal."""
    assert one_line("x\n\x1b[1Apass runs") == "x\\n\\x1b[1Apass runs"


def _bound(paths):
    fmu, binding = paths
    return (fmu, "--binding", binding)


def test_a_vendors_fmu_stands_in_a_case(gfor, gallery, case, tmp_path):
    """In kiloampere and qd, in a process of its own, from the power flow: it stays in steady state until the event."""
    path = case(*gallery("converter_qd_si"))
    code, _, error = gfor("run", path, "--stop", "1.2", "--out", tmp_path / "out")
    assert code == 0, error
    assert "there are no modes: component 'gfor'" in error
    run = xr.open_dataset(tmp_path / "out" / "vendor" / "trajectory.nc")
    before = run["gfor.p"].sel(time=slice(0, 1.0))
    assert float(abs(before - 0.9).max()) < 1e-9
    assert float(run["gfor.p"].isel(time=-1)) > 0.9  # the load step is seen
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["scenarios"][0]["residual"] is None


def test_a_vendors_fmu_that_crashes_leaves_what_was_computed(gfor, gallery, case, tmp_path):
    code, _, error = gfor(
        "run", case(gallery("crash")[0]), "--stop", "0.2", "--out", tmp_path / "out"
    )
    assert code == 1
    assert (
        "component 'gfor' at t = 0.05 s: fmi2DoStep returned crash: its process died with" in error
    )
    run = xr.open_dataset(tmp_path / "out" / "vendor" / "trajectory.nc")
    assert float(run["time"].max()) == pytest.approx(0.05, abs=0.0051)


def test_a_vendors_fmu_that_ends_by_itself_says_so(gfor, case, tmp_path):
    fmu = build(converter("ends_soon", ENDS_AT=0.05), tmp_path)
    code, _, error = gfor("run", case(fmu), "--stop", "0.1", "--out", tmp_path / "out")
    assert code == 1
    assert (
        "component 'gfor': it ended its simulation at t = 0.05 s by itself, which is no error; let the run"
        in error
    )
    run = xr.open_dataset(tmp_path / "out" / "vendor" / "trajectory.nc")
    assert float(run["time"].max()) == pytest.approx(0.05, abs=0.0051)


def test_a_sweep_computes_anew_what_a_changed_binding_or_fmu_decides(gallery, case, tmp_path):
    fmu, binding = (Path(shutil.copy(path, tmp_path)) for path in gallery("converter_qd_si"))
    path = case(fmu, binding)

    def key():
        plan = plan_sweep(load_case(path), SweepRequest([parse_vary("grid.X_L=0.1,0.3")]))
        return plan.task(plan.scenarios[0], (1,)).key

    first, text = key(), binding.read_text(encoding="utf-8")
    binding.write_text(f"# a remark\n{text}", encoding="utf-8")
    assert key() == first
    binding.write_text(text.replace("1500 MVA", "1600 MVA"), encoding="utf-8")
    second = key()
    assert second != first
    with zipfile.ZipFile(fmu, "a") as archive:  # and its guid stays
        archive.writestr("resources/tables.csv", "1,2")
    assert key() != second


def test_modes_say_why_a_black_box_has_none(gfor, gallery, case):
    code, _, error = gfor("modes", case(gallery("converter")[0]))
    assert code == 1
    assert "does not let a master set its continuous states" in error


def test_our_converter_as_a_foreign_file_has_the_same_modes(gfor, fmu_path, case, tmp_path):
    """In a process of its own, and in this one."""
    foreign = tmp_path / "foreign.fmu"
    foreign.write_bytes(fmu_path("gfor").read_bytes())
    found = [
        json.loads(gfor("modes", case(foreign, extra=extra), "--json")[1])["scenarios"][0]["modes"][
            0
        ]
        for extra in ("isolated = true\n", "isolated = false\n")
    ]
    assert found[0]["real"] == pytest.approx(-0.389, abs=0.002)
    assert found[0]["imag"] == found[1]["imag"]


def test_a_binding_without_an_fmu(gfor, case, tmp_path):
    path = case("x.fmu")
    path.write_text(
        path.read_text().replace('fmu = "x.fmu"', 'model = "gfor"\nbinding = "x.toml"'),
        encoding="utf-8",
    )
    code, _, error = gfor("modes", path)
    assert code == 2
    assert "'binding' is for an FMU of others" in error


def test_a_file_alone_brings_no_foreign_code_into_this_process(gfor, gallery, case):
    path = case(gallery("converter")[0], extra="isolated = false\n")
    code, _, error = gfor("run", path, "--stop", "0.001")
    assert code == 2
    assert "components.gfor.isolated: this file wants" in error
    assert "whatever you can; if you trust the FMU, say so by --trust-fmus" in error
    with pytest.raises(CaseError, match="trust_fmus=True"):
        load(path).scenario("vendor").prepared  # noqa: B018


def test_the_user_may_trust_it(gfor, gallery, case, tmp_path):
    path = case(gallery("converter")[0], extra="isolated = false\n")
    assert (
        load(path, trust_fmus=True).scenario("vendor").prepared.system.components["gfor"].isolated
        is False
    )
    found = []
    for name, word in (("trusted", ["--trust-fmus"]), ("isolated", [])):
        if not word:
            path = case(gallery("converter")[0])
        code, _, error = gfor("run", path, "--stop", "0.001", "--out", tmp_path / name, *word)
        assert code == 0, error
        (scenario,) = json.loads((tmp_path / name / "summary.json").read_text())["scenarios"]
        found.append(scenario["isolated"])
        said = (
            "component 'gfor' runs in gfor's own process, because the case and --trust-fmus say so"
        )
        assert (said in scenario["warnings"], said in " ".join(error.split())) == (
            bool(word),
            bool(word),
        )
    assert found[0] == {}
    assert [p["name"] for p in found[1]["gfor"]] == list(NAMES)
    gfor("report", tmp_path / "trusted")
    assert "own process, because the case and --trust-fmus say so" in (
        tmp_path / "trusted" / "report.html"
    ).read_text(encoding="utf-8")
    gfor("report", tmp_path / "isolated")
    assert "gfor ran in a process of its own, with: the FMU&#x27;s processes end" in (
        tmp_path / "isolated" / "report.html"
    ).read_text(encoding="utf-8")
