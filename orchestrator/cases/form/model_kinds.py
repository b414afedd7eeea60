"""EMT and phasor models from one case: ``models`` of the file, or ``--set models=emt``, says which are taken."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.cases.form.build_choices import MODELS
from orchestrator.cases.form.names import TWINS
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import CaseTable, PlotTable, Value
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option

KINDS = ("emt", "phasor")

_GRIDS = {"grid": "phasor_grid", "two_area_grid": "two_area_phasor_grid"}
_SUFFIX = "_phasor"


def kind_wanted(
    overrides: Mapping[str, Value] | None, parameters: Sequence[ParameterFile]
) -> str | None:
    """The kind that the command line or a parameter file chooses; None where they leave it to the case."""
    layers = [file.values for file in parameters] + [dict(overrides or {})]
    given = [layer[MODELS] for layer in layers if MODELS in layer]
    if given and given[-1] not in KINDS:
        raise InputError(Option.SET + f" {MODELS}={given[-1]}: it must be emt or phasor")
    return str(given[-1]) if given else None


def of_kind(table: CaseTable, kind: str) -> CaseTable:
    """A case with all models of the catalogue of one kind, and what its table ``[emt]`` or ``[phasor]`` says.

    Signals that both kinds have under different names keep their meaning in plots and patterns."""
    special = table.emt if kind == "emt" else table.phasor
    components = {
        name: c if c.model is None else c.model_copy(update={"model": twin(c.model, kind)})
        for name, c in table.components.items()
    }
    changed: dict[str, Any] = {"models": kind, "components": components}
    if table.units is not None:
        both = {key: twin(getattr(table.units, key), kind) for key in ("generator", "converter")}
        changed["units"] = table.units.model_copy(update=both)
    if special.stray_B is not None and table.network is not None:
        changed["network"] = table.network.model_copy(update={"stray_B": special.stray_B})
    if special.step_size is not None:
        changed["solver"] = table.solver.model_copy(update={"step_size": special.step_size})
    if table.models is not None and table.models != kind:
        changed["plots"] = [_renamed(plot) for plot in table.plots]
    return table.model_copy(update=changed)


def twin(model: str, kind: str) -> str:
    """The model of the other kind with the same meaning; the name itself where it is of this kind already."""
    back = {phasor: emt for emt, phasor in _GRIDS.items()}
    emt = back.get(model, model.removesuffix(_SUFFIX))
    wanted = emt if kind == "emt" else _GRIDS.get(emt, f"{emt}{_SUFFIX}")
    from fmus.toolchain.catalogue import model_names  # noqa: PLC0415 - models, which most files are read without

    known = model_names()
    if model in known and wanted not in known:
        raise InputError(
            f"models = {kind!r}: the model {model!r} has no counterpart {wanted!r} in the catalogue"
        )
    return wanted


def _renamed(plot: PlotTable) -> PlotTable:
    return plot.model_copy(
        update={
            "panels": [
                p.model_copy(
                    update={"signal": _other(p.signal), "also": [_other(s) for s in p.also]}
                )
                for p in plot.panels
            ]
        }
    )


def _other(signal: str) -> str:
    head, dot, last = signal.rpartition(".")
    return f"{head}{dot}{TWINS.get(last, last)}"
