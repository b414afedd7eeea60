"""A model: its variables and its equations ẋ = f(x, u, p), y = g(x, u, p), with the initial state."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from fmus.toolchain.plan import Plan
from fmus.toolchain.symbols import Function
from fmus.toolchain.variables import (
    CalculatedParameter,
    Input,
    Kind,
    Output,
    Parameter,
    State,
    Variable,
)

Integrator = Literal["runge_kutta", "sdirk"]

FmiVersion = Literal["2.0", "3.0"]  # FMI versions of a native FMU


@dataclass(frozen=True)
class NodalEquations:
    """Y·v = i of a large network: a matrix whose pattern never changes, and currents.

    ``plan``: order and fill of the factorisation of Y; ``values``: (u, p, c) → real parts of the elements of Y in the
    plan's order, then their imaginary parts; ``currents``: (x, u, p, c) → real parts of i by bus, then imaginary parts;
    ``given``: numbers of the inputs that Y depends on."""

    plan: Plan
    values: Function
    currents: Function
    given: tuple[int, ...]


@dataclass(frozen=True)
class Model:
    """Variables and equations of one device or network.

    ``name``, ``title``: identifier of the FMU, and a line for people; ``parameters``, ``calculated``, ``inputs``,
    ``states``, ``outputs``: declarations, in the order of the vectors p, c, u, x, y; ``initialise``: p → (c, x):
    set-points and states of the operating point; ``derivatives``, ``outputs_function``: (x, u, p, c) → ẋ, and → y;
    ``requirements``: (p, c) → r; the model may run where every r > 0; ``requirement_texts``: the rule behind each r,
    with its remedy; ``integrator``: ``runge_kutta`` (explicit, order 4) or ``sdirk`` (L-stable, order 2, for stiff
    models that are linear in x but for what ``implicit`` leaves out); ``implicit``: (x, u, p, c) → the part of ẋ that
    an implicit step solves for; None for all of ẋ; ``nodal``: equations of a large network, which a kernel solves as
    data. Their voltages are a fifth argument of ``derivatives`` and ``outputs_function`` then; ``kind``: what the
    component is in a power system; ``of_parts``: whether it is made of parts that somebody chose, so that few have the
    same."""

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    calculated: tuple[CalculatedParameter, ...]
    inputs: tuple[Input, ...]
    states: tuple[State, ...]
    outputs: tuple[Output, ...]
    initialise: Function
    derivatives: Function
    outputs_function: Function
    requirements: Function
    requirement_texts: tuple[str, ...]
    integrator: Integrator = "runge_kutta"
    implicit: Function | None = None
    nodal: NodalEquations | None = None
    kind: Kind = ""
    of_parts: bool = False

    @property
    def compiled(self) -> bool:
        """True if a Python-backed FMU has its functions compiled, where a compiler is there. It takes seconds, which a
        model that is new most times it is asked for does not have: it is a tape, with the same results."""
        return self.kind != "network" and not self.of_parts

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Every variable but the derivatives; the position is the FMI value reference."""
        return (*self.parameters, *self.calculated, *self.inputs, *self.states, *self.outputs)

    @cached_property
    def value_references(self) -> dict[str, int]:
        """Name → FMI value reference; ``der(state)`` follows after all others."""
        names = [v.name for v in self.variables] + [f"der({s.name})" for s in self.states]
        return {name: index for index, name in enumerate(names)}
