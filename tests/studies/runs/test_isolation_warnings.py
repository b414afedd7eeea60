"""What a run says of FMUs that run in gfor's own process."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from orchestrator.devices.fmi import instance
from orchestrator.studies.runs.run import _isolation_warnings
from orchestrator.systems.coupling.system import ComponentPlan


@pytest.mark.parametrize(
    ("ours", "isolated", "said"),
    [(False, False, 1), (False, None, 0), (False, True, 0), (True, False, 0)],
)
def test_a_strangers_fmu_that_is_trusted_is_told(monkeypatch, ours, isolated, said):
    monkeypatch.setattr(instance, "is_ours", lambda path: ours)
    plan = ComponentPlan(SimpleNamespace(path=Path("vendor.fmu")), isolated=isolated)
    prepared = SimpleNamespace(system=SimpleNamespace(components={"vendor": plan}))
    found = _isolation_warnings(prepared, {})
    assert len(found) == said
    assert all("'vendor' runs in gfor's own process" in one for one in found)
