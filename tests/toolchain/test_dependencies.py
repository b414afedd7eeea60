"""Dependencies in a model description against full matrices, and against what moves when a value moves."""

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port
from fmus.grid.phasor_grid import phasor_grid
from fmus.toolchain import dependencies
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.dependencies import structure, unlisted
from fmus.toolchain.description import model_description
from fmus.toolchain.symbols import symbols_in
from orchestrator.devices.fmi.description import parse_description


def _chain(buses):
    names = tuple(f"b{k}" for k in range(buses))
    lines = tuple(
        Line(f"l{k}", names[k], names[k + 1], X=0.1, R=0.01, B=0.02) for k in range(buses - 1)
    )
    return Network(
        "chain", names, lines, (Load("load", names[-1], 50.0, 10.0),), (Port("unit", names[0]),)
    )


def _full(function, output, input_):
    """Whether each element of the output can move with each element of the input."""
    depends = [symbols_in([value]) for value in function.outputs[output]]
    found = [symbol in own for own in map(set, depends) for symbol in function.inputs[input_]]
    return np.array(found, dtype=bool).reshape(len(depends), len(function.inputs[input_]))


@pytest.mark.parametrize(
    "name", ["gfor", "synchronous_generator_ac4a", "infinite_bus", "chain of 12 buses"]
)
def test_initial_unknowns_follow_full_matrices(name):
    """An initial output or derivative depends on a parameter directly, by a calculated value or by an initial state."""
    model = grid(_chain(12)) if name.startswith("chain") else build_model(name)
    found = {unknown.reference: unknown.known for unknown in structure(model).initial}
    first_input = len(model.parameters) + len(model.calculated)
    first_output = first_input + len(model.inputs) + len(model.states)
    for first, function in (
        (first_output, model.outputs_function),
        (first_output + len(model.outputs), model.derivatives),
    ):
        x, u, p, c = (_full(function, 0, k) for k in range(4))
        by_parameter = p | (
            x.astype(int) @ _full(model.initialise, 1, 0)
            + c.astype(int) @ _full(model.initialise, 0, 0)
            > 0
        )
        for row in range(len(u)):
            wanted = (*np.flatnonzero(by_parameter[row]), *(first_input + np.flatnonzero(u[row])))
            assert found[first + row] == wanted


def test_long_lists_are_left_out_and_short_ones_stay(monkeypatch, tmp_path):
    """All voltages of a meshed network depend on all emfs, which an FMU says without lists. An EMT network's do not."""
    meshed, sparse = phasor_grid(_chain(40)), grid(_chain(40))
    whole = structure(sparse)
    assert all(unknown.known for unknown in structure(meshed).outputs)
    monkeypatch.setattr(dependencies, "MOST", 4 * len(sparse.outputs) * 12)
    assert len(sparse.outputs) * len(sparse.parameters) > dependencies.MOST
    assert structure(sparse) == whole
    found = structure(meshed)
    assert [unknown.reference for unknown in found.outputs] == [
        u.reference for u in unlisted(meshed).outputs
    ]
    assert all(unknown.known is None for unknown in found.initial[-len(meshed.outputs) :])
    monkeypatch.setattr(dependencies, "MOST", 10)
    text = model_description(meshed, "guid", "meshed", "tool")
    described = parse_description(tmp_path / "meshed.fmu", text)
    assert (
        described.feedthrough("b3.v_re") == described.inputs == tuple(v.name for v in meshed.inputs)
    )
