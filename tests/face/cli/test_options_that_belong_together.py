"""Options that need another one: refused, or told, before anything is computed."""

from argparse import Namespace
from pathlib import Path
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.cli import checkpoints, new
from tests.support.scenarios import bare_scenario


@pytest.mark.parametrize("given", ["fmu", "dll", "binding"])
def test_a_device_needs_a_place(given):
    options = Namespace(
        fmu=None,
        dll=None,
        binding=None,
        converter=None,
        models=None,
        out=None,
        files=[Path("a.raw")],
    )
    setattr(options, given, Path("vendor.file"))
    with pytest.raises(InputError, match="are for a converter; say where by --converter"):
        new._wanted_case(options)


@pytest.mark.parametrize(
    ("checkpoint", "required", "said"),
    [(5.0, False, "told"), (None, True, "refused"), (5.0, True, "refused"), (None, False, "")],
)
def test_what_cannot_be_resumed_is_told_before_the_run(monkeypatch, checkpoint, required, said):
    told = []
    monkeypatch.setattr(
        checkpoints, "not_kept", lambda prepared: {"vendor": "it cannot serialise its state"}
    )
    monkeypatch.setattr(checkpoints, "warn", lambda name, texts: told.extend(texts))
    plan = SimpleNamespace(description=SimpleNamespace(path=Path("vendor.fmu")))
    scenario = bare_scenario(system=SimpleNamespace(components={"vendor": plan}))
    options = Namespace(checkpoint=checkpoint, require_checkpoint=required)
    if said == "refused":
        with pytest.raises(InputError, match="leave --require-checkpoint out"):
            checkpoints._name_those_not_kept([scenario], options)
    else:
        checkpoints._name_those_not_kept([scenario], options)
    assert len(told) == (said == "told")
