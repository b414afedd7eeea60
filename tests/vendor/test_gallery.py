"""Every faulty FMU is caught by the name of its fault, and no good one is failed: the confusion table."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.native_fmu import cached_native
from orchestrator.fmi.limits import Limits
from orchestrator.vendor.runner import check_fmu
from tests.vendor.gallery.hostile import HOSTILE
from tests.vendor.gallery.members import faulty, good

TABLE = Path(__file__).parent / "gallery" / "README.md"
OURS = ("gfor", "synchronous_generator_st1", "synchronous_generator_st4b", "two_area_grid")
LIMITS = Limits(seconds=6.0)
"""Less than a user's, so that what hangs is given up soon."""


def checked(path, binding=None):
    return check_fmu(path, binding, LIMITS, run_for=0.5)


@pytest.mark.parametrize(
    ("name", "only"),
    [
        ("hidden_state", "state"),
        ("sign_bound", "power_balance"),
        ("delayed", "delay"),
        ("step_dependent", "step_invariance"),
        ("rounded_steps", "internal_step"),
        ("shared", "independence"),
        ("crash", "runs"),
        ("undeclared_feedthrough_lag", "feedthrough"),
        ("reset_parameter", "reset"),
    ],
)
def test_a_check_finds_its_fault_and_leaves_the_good_one_alone(name, only, gallery):
    member = next(m for m in faulty() if m.name == name)
    found = check_fmu(*gallery(name), LIMITS, (only,), run_for=0.3)
    assert found.faults == [member.fault]
    (failure,) = found.failures
    assert failure.evidence
    assert failure.remedy
    clean = check_fmu(*gallery("lag" if name.endswith("lag") else "converter"), LIMITS, (only,), run_for=0.3)
    assert clean.trusted
    assert clean.results[-1].verdict == "pass"


@pytest.mark.slow
def test_the_confusion_table(gallery, fmu_path, tmp_path):
    rows = [("good", m.name, "", *gallery(m.name)) for m in good()]
    rows += [("good", f"{name} (Python-backed)", "", fmu_path(name), None) for name in OURS]
    rows += [("good", f"{name} (native)", "", cached_native(build_model(name)), None) for name in OURS]
    rows += [("faulty", m.name, m.fault, *gallery(m.name)) for m in faulty()]
    plain, _ = gallery("gain")
    rows += [("faulty", name, fault, make(tmp_path, plain), None) for name, (make, fault) in HOSTILE.items()]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(lambda row: checked(*row[3:]), rows))
    lines, wrong = [], []
    for (kind, name, fault, *_), report in zip(rows, reports, strict=True):
        caught = (fault in report.faults) if kind == "faulty" else report.trusted
        assert not [r for r in report.results if "failed by itself" in r.evidence]
        also = [f for f in report.faults if f != fault]
        lines.append(f"| {name} | {fault or '—'} | {'yes' if caught else 'NO'} | {', '.join(also) or '—'} |")
        wrong += [] if caught else [f"{name}: {fault or 'good'}, found {report.faults}: {report.failures}"]
    assert not wrong, "\n".join(wrong)
    table = "\n".join(["| FMU | its fault | caught, or passed if good | also found |", "|---|---|---|---|", *lines])
    if os.environ.get("GFOR_WRITE_TABLES"):
        head = TABLE.read_text(encoding="utf-8").partition("| FMU |")[0]
        TABLE.write_text(f"{head}{table}\n", encoding="utf-8")
    written = TABLE.read_text(encoding="utf-8")
    for line in lines:
        assert " | ".join(line.split(" | ")[:3]) in written, line
