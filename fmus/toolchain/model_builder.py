"""How a model is written: each declaration returns a symbol.

A quantity is declared where it is used, and the equations read like the block diagram."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeVar

from fmus.toolchain.model import Integrator, Model
from fmus.toolchain.nodal_equations import Complex, Nodes
from fmus.toolchain.symbols import (
    Expr,
    Function,
    Scalar,
    depends_on,
    substitute,
    symbol,
    symbols_in,
)
from fmus.toolchain.variables import (
    UNITS,
    CalculatedParameter,
    Input,
    Kind,
    Output,
    Parameter,
    State,
    Usual,
    Variable,
    VariableType,
)

_Kind = TypeVar("_Kind", bound=Variable)


class ModelBuilder:
    """Collects declarations and equations of one model.

    ``name``: identifier of the FMU (letters, digits, underscore); ``title``: one line that says what the model is;
    ``internal_step``, ``longest_step``: default and maximum of the parameter ``internal_step`` [s]. The defaults are
    for electromagnetic transients. ``usual``: ranges of parameters by their full name."""

    def __init__(
        self,
        name: str,
        title: str,
        internal_step: float = 1e-4,
        longest_step: float = 2e-4,
        *,
        kind: Kind = "",
        usual: Mapping[str, Usual] | None = None,
    ) -> None:
        self.name, self.title, self.kind, self._usual = name, title, kind, usual or {}
        self._prefix: list[str] = []
        self._declared: dict[str, tuple[Variable, Expr]] = {}
        self._expressions: dict[str, Expr] = {}
        self._derivatives: dict[str, Expr] = {}
        self._implicit: dict[str, Expr] = {}
        self._requirements: list[tuple[Expr, str]] = []
        self._opened: list[Expr] = []
        self._algebraic: list[tuple[Expr, Expr]] = []
        self._nodes: Nodes | None = None
        self._handed_over: dict[str, Expr] = {}
        self.internal_step = self.parameter(
            "internal_step",
            internal_step,
            "s",
            "Longest internal Runge-Kutta step; a communication step is cut into equal parts no longer than this",
            minimum=1e-6,
            maximum=longest_step,
        )

    @contextmanager
    def scope(self, name: str) -> Iterator[None]:
        """Put ``name.`` before every name declared inside."""
        self._prefix.append(name)
        try:
            yield
        finally:
            self._prefix.pop()

    def _full(self, name: str) -> str:
        return ".".join([*self._prefix, name])

    def _declare(self, variable: Variable) -> Expr:
        if variable.name in self._declared:
            raise ValueError(f"model {self.name}: {variable.name!r} is declared twice")
        if isinstance(variable, Parameter) and variable.name in self._usual:
            variable = replace(variable, usual=self._usual[variable.name])
        made = symbol(variable.name)
        self._declared[variable.name] = (variable, made)
        return made

    def declare(self, variable: Parameter | Input) -> Expr:
        """Declare a parameter or an input that is described elsewhere, such as one of the port's."""
        return self._declare(replace(variable, name=self._full(variable.name)))

    def declare_output(self, variable: Output, value: Scalar) -> None:
        """Declare an output that is described elsewhere as a function of states, inputs and parameters."""
        self.output(variable.name, value, variable.unit, variable.description, variable.base)

    def parameter(
        self,
        name: str,
        start: float,
        unit: str,
        description: str,
        *,
        base: str = "",
        minimum: float | None = None,
        maximum: float | None = None,
        tunable: bool = False,
        type: VariableType = "Real",
        source: str = "",
    ) -> Expr:
        """Declare a parameter.

        ``name``: without the scope; ``base``: what 1 pu is, such as ``"S_n"``; required where the unit is ``pu``;
        ``minimum``, ``maximum``: bounds; None for an unbounded side; ``tunable``: whether it can be set at any
        communication point, not only before initialisation; ``type``: in the equations an Integer or a Boolean is a
        number as well; ``source``: source of the default value; empty if it is not given."""
        return self._declare(
            Parameter(
                self._full(name),
                unit,
                description,
                base,
                start=float(start),
                minimum=minimum,
                maximum=maximum,
                tunable=tunable,
                type=type,
                source=source,
            )
        )

    def switch(self, name: str, start: bool, description: str, *, tunable: bool = False) -> Expr:
        """Declare a Boolean parameter; in the equations it is 0 or 1."""
        return self.parameter(name, float(start), "1", description, tunable=tunable, type="Boolean")

    def calculated(
        self, name: str, value: Scalar, unit: str, description: str, base: str = ""
    ) -> Expr:
        """Declare a quantity computed at initialisation from fixed parameters.

        ``value``: an expression of fixed parameters."""
        full = self._full(name)
        self._expressions[full] = Expr(value)
        return self._declare(CalculatedParameter(full, unit, description, base))

    def input(
        self, name: str, unit: str, description: str, *, base: str = "", start: float = 0.0
    ) -> Expr:
        """Declare an input.

        ``start``: its value until it is set."""
        return self._declare(Input(self._full(name), unit, description, base, start))

    def state(
        self,
        name: str,
        initial: Scalar,
        unit: str,
        description: str,
        base: str = "",
        *,
        stepwise: bool = False,
    ) -> Expr:
        """Declare a continuous state.

        ``initial``: its initial value, an expression of parameters; ``unit``: one of `UNITS`; the same per second must
        be one of them too; ``stepwise``: whether it is held during a communication step, as inputs are, and moves by
        rate × step size at its end."""
        full = self._full(name)
        if f"{unit}/s" not in UNITS:
            raise ValueError(
                f"state {full!r} is in {unit!r}; add its rate {unit + '/s'!r} to UNITS as well"
            )
        self._expressions[full] = Expr(initial)
        return self._declare(State(full, unit, description, base, stepwise))

    def hand_over(self, name: str, signal: Expr) -> None:
        """Keep a signal of one part of the model for the part that takes it by this name."""
        if name in self._handed_over:
            raise ValueError(f"model {self.name}: {name!r} is handed over twice")
        self._handed_over[name] = signal

    def handed_over(self, name: str) -> Expr | None:
        """Return the signal that another part has handed over by this name; None if there is none."""
        return self._handed_over.get(name)

    def derivative(self, state: Expr, rate: Scalar, implicit: Scalar | None = None) -> None:
        """Give the time derivative of a declared state.

        ``rate``: [unit of the state per second]; ``implicit``: the part of the rate that an implicit integrator solves
        for; it is linear in the states. By default all of it. What is left is evaluated at the stages of a step and
        must be slow against it."""
        declared = self._declared.get(state.name())
        if declared is None or not isinstance(declared[0], State):
            raise ValueError(
                f"model {self.name}: {state.name()!r} is no declared state and can have no derivative"
            )
        if state.name() in self._derivatives:
            raise ValueError(f"model {self.name}: state {state.name()!r} has two derivatives")
        self._derivatives[state.name()] = Expr(rate)
        if implicit is not None:
            self._implicit[state.name()] = Expr(implicit)

    def output(self, name: str, value: Scalar, unit: str, description: str, base: str = "") -> None:
        """Declare an output as a function of states, inputs and parameters.

        ``value``: an expression of states, inputs and parameters."""
        full = self._full(name)
        self._expressions[full] = Expr(value)
        self._declare(Output(full, unit, description, base))

    def algebraic(self, name: str) -> Expr:
        """Return a symbol for a signal that is used before it can be written; `close` gives its value."""
        self._opened.append(symbol(self._full(name)))
        return self._opened[-1]

    def close(self, signal: Expr, value: Scalar) -> None:
        """Give the value of an `algebraic` signal; a `ValueError` if it depends on the signal itself."""
        value = Expr(value)
        if depends_on([value], [signal]):
            raise ValueError(
                f"model {self.name}: signal {signal.name()!r} depends directly on itself"
            )
        self._algebraic.append((signal, value))

    def nodes(
        self, elements: Mapping[tuple[int, int], Complex], currents: Sequence[Complex]
    ) -> list[tuple[Expr, Expr]]:
        """Let the kernel solve complex nodal equations Y·v = i as data; returns real and imaginary part of each v."""
        self._nodes = Nodes(elements, currents)
        return self._nodes.voltages

    def require(self, positive: Scalar, rule: str) -> None:
        """Refuse to initialise (or to go on, for tunable parameters) unless ``positive`` > 0."""
        self._requirements.append((Expr(positive), rule))

    def build(self, integrator: Integrator = "runge_kutta") -> Model:
        """Return the finished model.

        Raises a `ValueError` if a state has no derivative, or a calculated parameter or initial state depends on
        something other than parameters."""
        parameters, p = self._declared_as(Parameter)
        calculated, c = self._declared_as(CalculatedParameter)
        inputs, u = self._declared_as(Input)
        states, x = self._declared_as(State)
        outputs, _ = self._declared_as(Output)
        algebraic = self._closed_signals()
        self._check_origins(p)
        missing = [s.name for s in states if s.name not in self._derivatives]
        if missing:
            raise ValueError(f"model {self.name}: no derivative is given for {', '.join(missing)}")
        if integrator == "sdirk":
            self._check_for_sdirk(states)

        def collect(variables: Sequence[Variable], values: dict[str, Expr]) -> list[Expr]:
            found = [values[variable.name] for variable in variables]
            for signal, value in algebraic:
                found = substitute(found, [signal], [value])
            return found

        c_value = self._calculate(calculated, c)
        x_value = substitute(collect(states, self._expressions), c, c_value)
        r_value = [value for value, _ in self._requirements]
        arguments = [x, u, p, c]
        nodal = None
        if self._nodes is not None:
            nodal = self._nodes.equations(x, u, p, c)
            arguments.append(self._nodes.symbols)
        implicit = None
        if self._implicit:
            rates = collect(states, self._derivatives | self._implicit)
            implicit = Function("implicit", arguments, [rates])
        return Model(
            name=self.name,
            title=self.title,
            parameters=parameters,
            calculated=calculated,
            inputs=inputs,
            states=states,
            outputs=outputs,
            initialise=Function("initialise", [p], [c_value, x_value]),
            derivatives=Function("derivatives", arguments, [collect(states, self._derivatives)]),
            outputs_function=Function("outputs", arguments, [collect(outputs, self._expressions)]),
            requirements=Function("requirements", [p, c], [r_value]),
            requirement_texts=tuple(text for _, text in self._requirements),
            integrator=integrator,
            implicit=implicit,
            nodal=nodal,
            kind=self.kind,
        )

    def _declared_as(self, kind: type[_Kind]) -> tuple[tuple[_Kind, ...], list[Expr]]:
        """The variables of one kind, and their symbols or expressions."""
        entries = [(v, symbol) for v, symbol in self._declared.values() if type(v) is kind]
        return tuple(v for v, _ in entries), [symbol for _, symbol in entries]

    def _check_for_sdirk(self, states: Sequence[State]) -> None:
        """Refuse parts of a model that the implicit integrator cannot solve."""
        if any(state.stepwise for state in states):
            raise ValueError(
                f"model {self.name}: the implicit integrator knows no stepwise states; take runge_kutta"
            )
        if self._nodes is not None:
            raise ValueError(
                f"model {self.name}: the implicit integrator solves no nodal equations; take runge_kutta"
            )

    def _calculate(
        self, calculated: Sequence[CalculatedParameter], c: Sequence[Expr]
    ) -> list[Expr]:
        """Express every calculated parameter by parameters alone; each may use those declared before it."""
        tunable = [s for v, s in self._declared.values() if isinstance(v, Parameter) and v.tunable]
        values: list[Expr] = []
        for index, variable in enumerate(calculated):
            values += substitute([self._expressions[variable.name]], c[:index], values)
        if depends_on(values, tunable):
            first = next(
                variable.name
                for variable, value in zip(calculated, values, strict=True)
                if depends_on([value], tunable)
            )
            raise ValueError(
                f"model {self.name}: {first!r} is computed once, at initialisation, "
                "and must not depend on a tunable parameter"
            )
        return values

    def _closed_signals(self) -> list[tuple[Expr, Expr]]:
        """Algebraic signals in an order in which each can be substituted once and for all.

        Raises a `ValueError` if one was never closed, or several depend on one another in a circle."""
        closed = [symbol.name() for symbol, _ in self._algebraic]
        never = [symbol.name() for symbol in self._opened if symbol.name() not in closed]
        if never:
            raise ValueError(
                f"model {self.name}: signal {', '.join(never)} is used but never closed"
            )
        waiting = list(self._algebraic)
        ordered: list[tuple[Expr, Expr]] = []
        for _ in range(len(waiting)):
            for signal, given in list(waiting):
                value = given
                for other, known in ordered:
                    (value,) = substitute([value], [other], [known])
                if not depends_on([value], self._opened):
                    ordered.append((signal, value))
                    waiting = [entry for entry in waiting if entry[0].name() != signal.name()]
        if waiting:
            names = ", ".join(symbol.name() for symbol, _ in waiting)
            raise ValueError(
                f"model {self.name}: signals {names} depend on one another in a circle"
            )
        return ordered

    def _check_origins(self, p: list[Expr]) -> None:
        """Calculated parameters and initial states come from parameters (and calculated ones) alone."""
        allowed = {s.name() for s in p} | {
            v.name for v, _ in self._declared.values() if isinstance(v, CalculatedParameter)
        }
        given = {
            v.name: self._expressions[v.name]
            for v, _ in self._declared.values()
            if isinstance(v, CalculatedParameter | State)
        }
        if {s.name() for s in symbols_in([*given.values()])} <= allowed:
            return
        for name, value in given.items():
            others = {s.name() for s in symbols_in([value])} - allowed
            if others:
                raise ValueError(
                    f"model {self.name}: {name!r} must follow from parameters at initialisation, "
                    f"but depends on {', '.join(sorted(others))}"
                )
