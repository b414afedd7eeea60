"""Every model's defaults, and its outputs and rates at one point off its equilibrium, as a table has them.

A case that leaves a value out gets the default without a word, so that a changed one is a changed answer.

Other tests show that equations are right; this one that none changed unseen, in a term or a factor that they do not
reach. Whoever changes one on purpose writes figures.json anew, `python -m tests.models.test_figures`, and reads the
difference.
"""

import json
from functools import partial
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

from fmus.grid.network import Line, Load, Network, Port, Shunt, ThreeWinding, Zip
from fmus.synchronous_generator.parts import EXCITERS, GOVERNORS, MACHINES, STABILIZERS
from fmus.toolchain.catalogue import build_model, entry_of, model_names, needs_arguments
from fmus.vendor_dll.circuit import converter_circuit
from tests.models.parts import exciter, governor, stabilizer
from tests.support.evaluated import Evaluated

TABLE = Path(__file__).with_name("figures.json")


def of_catalogue(name, **parts):
    return Evaluated(build_model(name, **parts))


def circuit(kind, bridge):
    """What stands around a vendor's controller."""
    return Evaluated(converter_circuit("circuit", kind, bridge))


SMALL = Network(
    "small",
    ("a", "b", "c", "d"),
    (
        Line("ab", "a", "b", X=0.05, R=0.004, B=0.3),
        Line("bc", "b", "c", X=0.08, R=0.01, tap=1.05, shift=0.1),
        Line("ca", "c", "a", X=0.12, B=0.1, X_C=0.03),
    ),
    (
        Load("city", "b", 80.0, 30.0, Zip(0.2, 0.3, 0.5), Zip(0.5, 0.1, 0.4), k_pf=1.2, k_qf=-0.8),
        Load("plant", "c", 50.0, -10.0),
        Load("sun", "d", -20.0, 5.0, Zip(i=1.0), Zip(i=1.0)),
        Load("village", "d", 5.0),
    ),
    (Port("one", "a"), Port("two", "c")),
    (Shunt("coil", "b", b_mvar=-20.0, switched=True), Shunt("bank", "d", g_mw=1.0, b_mvar=15.0)),
    faults=("b",),
    transformers=(
        ThreeWinding(
            "t", ("a", "b", "d"), (0.1, 0.12, -0.02), (0.002, 0.003, 0.001), (1.03, 1.0, 0.97)
        ),
    ),
    injections=("c",),
)
KEPT = {"f_n", "S_n", "internal_step"}
MODELS = {
    **{
        f"small {name}": partial(of_catalogue, name, network=SMALL)
        for name in ("grid", "phasor_grid")
    },
    **{
        name: partial(of_catalogue, name)
        for name in model_names()
        if entry_of(name).value.startswith(("fmus.", "gfor_fmu.")) and not needs_arguments(name)
    },
    **{
        f"machine {name}": partial(of_catalogue, "synchronous_generator_phasor", machine=name)
        for name in MACHINES
    },
    **{
        f"plant {records}": partial(of_catalogue, "wecc_plant_phasor", records=records)
        for records in (
            "REGCC1 REECC1 REPCA1",
            "REGCB1 REECD1 REPCA1 elsewhere",
            "REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1",
            "REGCB1 REECC1 REAX4BU1",
            "WT3G1 WT3E1 WT3T1 WT3P1",
            "WT4G1 WT4E1",
        )
    },
    **{f"exciter {name}": partial(exciter, name) for name in EXCITERS},
    **{f"governor {name}": partial(governor, name) for name in GOVERNORS},
    **{
        f"stabilizer {name}": partial(stabilizer, name)
        for name, part in STABILIZERS.items()
        if part is not None
    },
    **{
        f"circuit {kind} {bridge}": partial(circuit, kind, bridge)
        for kind, bridge in (("L", "modulation"), ("LC", "voltage"), ("LCL", "modulation"))
    },
}


def moved(variables, values, scale):
    """Values moved by up to the scale, by their names, so that a new variable moves none of the others."""
    by = scale * np.array([crc32(v.name.encode()) / 2**31 - 1 for v in variables])
    values = np.array([float(value or 0) for value in values])
    return values + by * np.where(values == 0, 1.0, values)


def elsewhere(parameters, on):
    """Other values of all that are real numbers, within their limits; switches on, or off, and what is counted at its
    largest, or one below."""
    given = {}
    for v, value in zip(
        parameters, moved(parameters, [v.start for v in parameters], 0.05), strict=True
    ):
        if v.type == "Real" and v.name not in KEPT:
            low, high = (
                (-np.inf if v.minimum is None else v.minimum),
                (np.inf if v.maximum is None else v.maximum),
            )
            given[v.name] = float(np.clip(abs(value) if v.start >= 0 else value, low, high))
        elif v.type == "Boolean":
            given[v.name] = float(on)
        elif v.type == "Integer":
            given[v.name] = v.maximum if on else max(v.minimum, v.maximum - 1)
    return given


def figures(name):
    one = MODELS[name]()
    found = {
        "defaults": {v.name: [v.start, v.unit, v.minimum, v.maximum] for v in one.model.parameters}
    }
    points = {
        "near": (0.02, {}),
        "far": (0.5, elsewhere(one.model.parameters, on=True)),
        "off": (0.5, elsewhere(one.model.parameters, on=False)),
    }
    for point, (scale, given) in points.items():
        one = Evaluated(one.model, given)
        x = moved(one.model.states, one.x, scale)
        u = moved(one.model.inputs, [v.start for v in one.model.inputs], scale)
        calculated = {v.name: one.parameters[v.name] for v in one.model.calculated}
        for kind, values in (
            ("outputs", one.outputs(u, x)),
            ("rates", one.rates(u, x)),
            ("calculated", calculated),
        ):
            found[f"{point} {kind}"] = {
                key: float(f"{value:.10g}") for key, value in values.items()
            }
    return found


@pytest.fixture(scope="module")
def table():
    return json.loads(TABLE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", MODELS)
def test_a_model_has_the_figures_of_the_table(name, table):
    found, wanted = json.loads(json.dumps(figures(name))), table[name]
    assert found.pop("defaults") == wanted.pop("defaults")
    for kind, values in found.items():
        assert values == pytest.approx(wanted[kind], rel=1e-8, abs=1e-9), kind


def test_the_table_has_no_other_models(table):
    assert set(table) == set(MODELS)


def test_the_norms_exciter_has_the_values_of_its_table():
    """NTS 631, generator of area 1."""
    found = figures("synchronous_generator_st4b_pss2a")["defaults"]
    norm = {"K_PR": 3.15, "K_IR": 3.15, "T_A": 0.02, "K_P": 6.5, "K_C": -0.08}
    assert {name: found[f"exciter.{name}"][0] for name in norm} == norm


def written(name):
    kinds = [
        f"  {json.dumps(kind)}: {json.dumps(values, ensure_ascii=False)}"
        for kind, values in figures(name).items()
    ]
    return f"{json.dumps(name)}: {{\n" + ",\n".join(kinds) + "\n}"


if __name__ == "__main__":
    TABLE.write_text("{\n" + ",\n".join(map(written, MODELS)) + "\n}\n", encoding="utf-8")
