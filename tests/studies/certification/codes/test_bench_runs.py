"""Converters on the test bench: ours, and one without damping, with a certificate that is verified and forged."""

import json
from copy import deepcopy
from dataclasses import replace

import pytest

import orchestrator as gfor
from fmus.toolchain.compiler import host_platform
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.simulation.watch.finding import BENCH_RESONANCE
from orchestrator.studies.certification.codes import bench_point
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.rows_again import choose
from orchestrator.studies.certification.files import save
from orchestrator.studies.certification.kinds import ROWS
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.certification.verification import read_certificate, verify_files
from orchestrator.studies.points.executor import Serial
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import device
from tests.support.grid_codes import replace_code

pytestmark = pytest.mark.slow


@pytest.fixture
def converter(fmu_path):
    """Compiled, which gives what the one with Python in it gives in half the time; in this process, as ours are."""
    return fmu_path("gfor", native=True)


@pytest.fixture
def follower(fmu_path):
    return fmu_path("gfl", native=True)


@pytest.fixture
def one_row(monkeypatch):
    """ERCOT's table with its jumps alone: a certificate that holds has all rows of the table."""
    code = replace(ERCOT, rows=tuple(row for row in ERCOT.rows if row.name == "phase_jumps"))
    replace_code(monkeypatch, code)
    return code


@pytest.fixture(name="gfor_command")
def _gfor_command(request):
    """The command of the same name as the module that is imported here."""
    return request.getfixturevalue("gfor")


def test_what_only_the_damping_test_has_is_refused(converter, gfor_command):
    code, _, said = gfor_command("certify", converter, "--code", "ercot", "--reactances", "0.1")
    assert code == 2
    assert "--reactances: only --code nts631 has it" in " ".join(said.split())


@pytest.mark.parametrize("code", ["ercot", "nts631"])
def test_a_value_that_cannot_be_is_told_at_its_option_with_its_choices(
    converter, tmp_path, gfor_command, code
):
    """And at no line of a file that the user did not write."""
    words = ["--code", code, "--no-check", "--reactances", "0.1"][: 3 if code == "ercot" else 5]
    out = ["--out", tmp_path / "out"]
    for value, rule in (("two", "it must be one of its numbers"), ("7", "it must be at most 3")):
        ended, _, said = gfor_command(
            "certify", converter, *words, *out, "--set", f"current_limit.kind={value}"
        )
        said = " ".join(said.split())
        assert ended == 2
        assert f"--set current_limit.kind={value}: current_limit.kind = " in said
        assert f"{rule} (0: box in q and d; 1: circular; " in said
        assert "line " not in said


def test_ours_meets_the_jump_is_kept_and_its_certificate_verifies(
    converter, tmp_path, one_row, gfor_command
):
    def certified():
        return certify_code(CertificationRequest(converter), one_row, Serial(), tmp_path)

    found = certified()
    assert [v.accepted for v in found.verdicts] == [True]
    assert found.verdict == "incomplete"  # further rows of the tests were not at hand
    assert certified().stored == 1
    save(found, tmp_path)
    folder, content = read_certificate(tmp_path)
    assert verify_files(folder, content).holds
    for option, words in (("--points=0.1", "give --rows"), ("--rows=none", "it has: phase_jumps")):
        code, _, said = gfor_command("verify", tmp_path, option)
        assert code == 2
        assert words in " ".join(said.split())
    code, said, _ = gfor_command("verify", tmp_path, "--workers", 1)
    assert code == 3  # it holds, and is incomplete
    assert "row phase_jumps, computed anew: its response, and its criteria" in said
    other = deepcopy(content)
    other["rows"][0]["findings"] = [{"kind": "loss_of_synchronism", "time": 2.0, "message": ""}]
    (fault,) = ROWS.verify(folder, other, ["phase_jumps"], Serial()).faults
    assert (
        fault == "row phase_jumps: the watch finds nothing, and loss of synchronism was certified"
    )
    other["values"] = {"droop.R_f": 0.1}
    assert "not what the table of ercot and the certified values give" in " ".join(
        verify_files(folder, other).faults
    )
    other["values"], other["f_n"] = {"S_n": 50.0}, 50.0
    assert "'departures' is" in " ".join(verify_files(folder, other).faults)
    content["rows"][0]["criteria"][1]["value"] += 0.1
    content["verdict"] = "passes"
    (tmp_path / "certificate.json").write_text(json.dumps(content), encoding="utf-8")
    faults = " ".join(verify_files(*read_certificate(tmp_path)).faults)
    assert "come to other findings" in faults
    assert '\'verdict\' is "passes", and "incomplete" comes out' in faults


def test_a_row_of_another_converter_is_seen_when_it_is_computed_anew(
    converter, follower, tmp_path, one_row, gfor_command
):
    """All hashes fit, and every verdict follows from the responses; these are those of ours."""
    folders = [tmp_path / "ours", tmp_path / "theirs"]
    found = []
    for folder, fmu in zip(folders, (converter, follower), strict=True):
        folder.mkdir()
        found.append(certify_code(CertificationRequest(fmu), one_row, Serial(), folder))
    ours, theirs = found
    assert (ours.verdict, theirs.verdict) == ("incomplete", "fails")
    save(replace(theirs, results=ours.results, verdicts=ours.verdicts), folders[1])
    assert verify_files(*read_certificate(folders[1])).holds
    assert gfor_command("verify", folders[1], "--files-only")[0] == 3
    code, said, _ = gfor_command("verify", folders[1], "--workers", 1)
    assert code == 5
    assert "row phase_jumps: v_re: it differs by up to" in said


def test_an_honest_device_that_feeds_the_bench_s_resonance_is_not_failed(
    tmp_path, one_row, gfor_command, in_process
):
    """Matching control, whose current lags by 3 ms, and whose verdict nobody can change by leaving the finding out."""
    fmu = build(device("matching", "MATCHING"), tmp_path)
    found = certify_code(CertificationRequest(fmu), one_row, Serial(), tmp_path / "out")
    (verdict,) = found.verdicts
    assert (found.verdict, verdict.is_judged, verdict.failed) == ("incomplete", False, [])
    (finding,) = (f for f in found.results["phase_jumps"].findings if f["kind"] == BENCH_RESONANCE)
    first, half, quarter = (
        finding[name] for name in ("frequency_hz", "frequency_at_0.5", "frequency_at_0.25")
    )
    row = one_row.rows[0].programme(found.f_n)
    reactance = row.impedance.imag * bench_point.CAPACITANCE
    assert first == pytest.approx(found.f_n / reactance**0.5, rel=0.25)
    assert [half, quarter] == pytest.approx([first * 2**0.5, 2 * first], rel=0.02)
    assert "row phase_jumps" in found.missing
    save(found, tmp_path / "out")
    folder, content = read_certificate(tmp_path / "out")
    assert verify_files(folder, content).holds
    code, said, _ = gfor_command("verify", tmp_path / "out", "--workers", 1)
    assert code == 3
    assert "row phase_jumps, computed anew: its response to t = " in said
    other = deepcopy(content)
    kept = [f for f in other["rows"][0]["findings"] if f["kind"] != BENCH_RESONANCE]
    other["rows"][0]["findings"] = kept
    (fault,) = ROWS.verify(folder, other, ["phase_jumps"], Serial()).faults
    assert "bench resonance" in fault
    assert not verify_files(folder, other).holds


def test_rows_are_drawn_by_their_margin_and_by_chance():
    rows = [
        {
            "row": name,
            "unknown": "",
            "accepted": accepted,
            "criteria": [{"margin": margin}, {"margin": None}],
        }
        for name, margin, accepted in (
            ("a", 0.5, True),
            ("b", 0.1, True),
            ("c", -3.0, False),
            ("d", 0.9, True),
        )
    ]
    rows.append({"row": "e", "unknown": "no licence", "accepted": None, "criteria": []})
    drawn = [choose({"rows": rows}) for _ in range(60)]
    assert {first for first, _ in drawn} == {"b"}
    assert {other for _, other in drawn} == {"a", "c", "d"}
    assert choose({"rows": rows}, every=True) == ["a", "b", "c", "d"]
    assert choose({"rows": rows}, ("d",)) == ["d"]


def test_a_converter_without_damping_does_not_settle(tmp_path):
    """A lag of 5 s in the droop's measurement leaves a swing of small damping. It runs in a process of its own."""
    built = gfor.build("gfor", tmp_path, native=True, platforms=[host_platform()])
    assert not is_ours(built)
    request = CertificationRequest(built, None, {"droop.tau_P": 5.0})
    (row,) = certify_code(request, ERCOT, Serial(), tmp_path, ("phase_jumps",)).verdicts
    assert not row.accepted
    assert "settles" in [finding.criterion for finding in row.failed]


@pytest.mark.parametrize(
    ("values", "rows", "accepted"),
    [
        ({"droop.R_f": 0.01}, ("dip_20", "dips_in_10_s", "rocof"), [True, True, False]),
        ({}, ("dip_20", "dip_45", "rocof", "phase_jumps"), [False, True, True, False]),
        ({"current_limit.kind": 2.0}, ("dip_65", "phase_jumps"), [False, True]),
    ],
)
def test_rows_of_ride_through_tell_settings_apart(converter, tmp_path, values, rows, accepted):
    """A weak droop keeps its angle in a dip and slips on a ramp; which limit of the current holds, the row decides."""
    request = CertificationRequest(converter, None, values)
    found = certify_code(request, CODES["prc029"], Serial(), tmp_path, rows).verdicts
    assert [(v.row.name, v.accepted) for v in found] == list(zip(rows, accepted, strict=True))


def test_the_limit_of_the_current_decides_whether_a_dip_to_nothing_is_ridden_through(
    converter, tmp_path
):
    for kind, accepted in ((0.0, False), (3.0, True)):
        request = CertificationRequest(converter, None, {"current_limit.kind": kind})
        (row,) = certify_code(
            request, CODES["nogrr245"], Serial(), tmp_path / f"{kind}", ("dip_0",)
        ).verdicts
        assert row.accepted == accepted


@pytest.mark.parametrize(("code", "row"), [("aemo", "jump_10"), ("fingrid", "jumps")])
def test_a_grid_following_converter_does_not_oppose_jumps(follower, tmp_path, code, row):
    """It rides through them, settles and returns; nothing else tells it from a grid-forming one."""
    (verdict,) = certify_code(
        CertificationRequest(follower), CODES[code], Serial(), tmp_path, (row,)
    ).verdicts
    assert {finding.criterion.split(" at ")[0] for finding in verdict.failed} == {
        "opposes the jump"
    }


def test_ours_and_its_duplicate_feed_the_load_without_the_source(converter, tmp_path):
    """The source turns on behind its open breaker; nobody has to keep step with it."""
    (row,) = certify_code(
        CertificationRequest(converter), CODES["miso"], Serial(), tmp_path, ("llsm_charging",)
    ).verdicts
    assert not row.failed


def test_a_row_that_fails_in_an_unexpected_way_leaves_the_others_standing(
    converter, tmp_path, monkeypatch
):
    """And it is not kept: the next start computes it."""
    whole = bench_point.running

    def breaking(prepared):
        master = whole(prepared)
        if prepared.case.path.name == case_name("inertia_up"):
            monkeypatch.setattr(master, "run", lambda *_: {}["licence"])
        return master

    def certified():
        return certify_code(
            CertificationRequest(converter),
            ERCOT,
            Serial(),
            tmp_path,
            ("inertia_up", "phase_jumps"),
        )

    monkeypatch.setattr(bench_point, "running", breaking)
    found = certified()
    assert [(v.row.name, v.is_judged, v.unknown) for v in found.verdicts] == [
        ("inertia_up", False, "KeyError: 'licence'"),
        ("phase_jumps", True, ""),
    ]
    assert found.verdict == "incomplete"
    assert "row inertia_up" in found.missing
    monkeypatch.setattr(bench_point, "running", whole)
    again = certified()
    assert again.stored == 1
    assert all(v.is_judged for v in again.verdicts)
