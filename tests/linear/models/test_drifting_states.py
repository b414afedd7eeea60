"""A store that goes on evenly and moves no port is held; one that moves its port is not, however slowly."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fmus.toolchain.exporter import export
from fmus.toolchain.frames import power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import declare_port_outputs, device_port
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.symbols import Expr
from gfor_fmu.converter import P_0, S_N, declare_converter, declare_converter_outputs
from gfor_fmu.usual_ranges import FORMING
from orchestrator.core.errors import AnalysisError, ErrorKind
from orchestrator.devices.fmi.description import read_description
from orchestrator.face.cli import main
from orchestrator.linear.models.drifting_states import examine_held
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one

HOURS = 2.0  # of the store, at S_n
CASE = """
name = "stored"
title = "A converter with a battery beside a machine"

[solver]
step_size = "100 us"
stop_time = "1 s"

[power_flow]
grid = "grid"
slack = "north"

[components.grid]
model = "grid"

[network]
buses = ["north", "south"]

[network.lines]
tie = { from = "north", to = "south", X = 0.05, R = 0.002, B = 0.2 }

[network.loads]
city = { bus = "south", p = "400 MW", q = "80 Mvar" }
town = { bus = "north", p = "300 MW" }

[components.gen]
model = "synchronous_generator_st1"
bus = "north"
parameters = { S_n = "900 MVA", v_0 = 1.02 }

[components.store]
FMU
bus = "south"
parameters = { S_n = "400 MVA", P_0 = 0.5, v_0 = 1.0 }
"""


def battery(moves=0.0, grows=0.0):
    """The converter with a state of charge, by which a part of its current may change.

    Its rate may grow, by so many parts of itself in a second."""
    m = ModelBuilder("battery", "Converter with a battery", kind="converter", usual=FORMING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    converter = declare_converter(m, port)
    charge = m.state("battery.charge", 0.6, "1", "State of charge")
    rate = -power(port.v, converter.current).re / (3600 * HOURS)
    if grows:
        age = m.state("battery.age", 0.0, "s", "Time")
        m.derivative(age, Expr(1.0))
        rate *= 1 + grows * age
    m.derivative(charge, rate)
    declare_port_outputs(m, port, converter.current * (1 + moves * (charge - 0.6)))
    declare_converter_outputs(m, converter)
    # as of parts: nobody has the same, and to compile it would take longer than all else here
    return replace(m.build(), of_parts=True)


@pytest.mark.parametrize("grows", [0.0, 0.5])
def test_a_rate_is_watched_over_a_thousand_steps(grows, tmp_path):
    """The charge is 0.3 + 0.2·(t + grows·t²/2), of which a step from t to t + H sees the mean rate."""
    m = ModelBuilder("charge", "A charge whose rate grows")
    age, charge = (m.state(name, at, "1", name) for name, at in (("age", 0.0), ("charge", 0.3)))
    m.derivative(age, Expr(1.0))
    m.derivative(charge, 0.2 * (1 + grows * age))
    m.output("y", Expr(0.0), "1", "Nothing")
    system, h = System(), 1e-3
    system.add("store", read_description(export(PythonFmu(m.build()), tmp_path)))
    with Master(system, gauss_seidel((("store",),)), h) as master:
        (held,) = examine_held(master, ["store.charge"])
    assert held.rate == pytest.approx(0.2 * (1 + grows * h / 2))
    assert held.later_rate == pytest.approx(0.2 * (1 + grows * (999.5 * h)), rel=1e-3)
    assert held.is_even is (grows == 0.0)


def linear_model(case):
    """The steady state and the eigenvalues of the whole system."""
    with running(prepare_one(case)) as master:
        point = find_operating_point(master)
        model = compose(Blocks(master), master.schedule)
        return point, np.log(np.linalg.eigvals(model.A)) / 1e-4


@pytest.fixture
def case(tmp_path, in_process):
    def write(**options):
        fmu = 'model = "gfor"'
        if options:
            export(PythonFmu(battery(**options)), tmp_path)
            fmu = 'fmu = "battery.fmu"'
        path = tmp_path / "stored.toml"
        path.write_text(CASE.replace("FMU", fmu), encoding="utf-8")
        return path

    return write


def test_the_rest_has_the_modes_that_it_has_without_the_store(case):
    """0.5 pu empties two hours in four; each eigenvalue but those of turned angles is that of the same without it."""
    _, without = linear_model(case())
    point, found = linear_model(case(moves=0.0))
    (held,) = point.held
    assert held.name == "store.battery.charge"
    assert held.value == pytest.approx(0.6)
    assert held.rate == pytest.approx(-0.5 / 7200, rel=1e-6)
    assert held.moves < 1e-12
    assert len(found) == len(without)
    moving = [value for value in found if abs(value) > 1e-3]
    assert len(moving) > 20
    for value in moving:
        assert np.abs(without - value).min() < 1e-6 * max(1, abs(value))


def test_the_result_says_what_is_held(case, capsys):
    main(["modes", str(case(moves=0.0)), "--json"])
    (scenario,) = json.loads(capsys.readouterr().out)["scenarios"]
    (said,) = (line for line in scenario["warnings"] if "battery.charge" in line)
    assert "moves no port" in said
    assert "held at 0.6" in said


@pytest.mark.parametrize("moves", [1e-3, 0.1])
def test_a_state_that_moves_its_port_slowly_is_not_held(moves, case):
    """The charge falls by 0.0042 in a minute: that takes away so much of 2 pu of current, on 100 MVA."""
    with pytest.raises(AnalysisError) as error:
        linear_model(case(moves=moves))
    assert error.value.kind is ErrorKind.STEADY_STATE
    assert "store.battery.charge goes on by -6.9" in str(error.value)
    assert "--black-box" in str(error.value)
    moved = float(re.search(r"moves store\.\S+ by (\S+) in 60 s", str(error.value))[1])
    assert moved == pytest.approx(2 * moves * 60 * 0.5 / 7200, rel=0.1)


def test_a_state_whose_rate_changes_is_not_held(case):
    with pytest.raises(AnalysisError, match="a second 1000 steps later"):
        linear_model(case(grows=0.5))
