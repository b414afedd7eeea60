"""The options that texts name, and commands with them, each as a value with its two spellings."""

from enum import Enum
from typing import Self

from orchestrator.core.spelling import Spelling

ALONE = "only the command line has it"
"""In the place of a keyword: Python has no such thing, and the option stays as it is typed."""


class Option(Spelling, Enum):
    """An option of the command line, with Python's keyword where that is spelt otherwise.

    As a string it is what is typed: ``"--out"``."""

    AGAINST = "against", ALONE
    AMBIENT = "ambient", ALONE
    AMPLITUDE = "amplitude"
    ANGLE = "angle"
    AT = "at"
    BESIDE = "beside"
    BINDING = "binding"
    BLACK_BOX = "black-box"
    BOUNDS = "bounds"
    BROKER = "broker", ALONE
    BROKER_PORT = "broker-port", ALONE
    BUS = "bus"
    BUSES = "buses"
    CASE = "case"
    CHANNEL = "channel", "channels"
    CHECK = "check"
    CHECKPOINT = "checkpoint", "checkpoints"
    CLEARED_AFTER = "cleared-after"
    CODE = "code"
    COLUMN = "column", ALONE
    COMPENSATION = "compensation"
    COMPONENT = "component"
    CONTEST = "contest", ALONE
    CONTINUOUS = "continuous"
    CONTROLLER = "controller"
    CONVERTER = "converter", ALONE
    CRITICAL = "critical"
    DAMPING = "damping"
    DAMPING_INCREMENT = "damping-increment"
    DECLARE = "declare", ALONE
    DELTA_GAIN = "delta-gain"
    DETAILS = "details", ALONE
    DETAILS_TEMPLATE = "details-template", ALONE
    DEVICE = "device"
    DIRECTIONAL = "directional"
    DLL = "dll"
    DYR_APPROXIMATE = "dyr-approximate", ALONE
    DYR_LEAVE_OUT = "dyr-leave-out", ALONE
    ENGINE_HELICS = "engine helics", "federates"
    EVENT = "event", "events"
    EXPLAIN = "explain"
    EXTERNAL = "external", ALONE
    FAULT = "fault"
    FEDERATE = "federate", "federates"
    FIT = "fit"
    FIXED = "fixed"
    FORCE = "force"
    FREQUENCY = "frequency"
    GAIN = "gain"
    GAIN_BOUNDS = "gain-bounds"
    GENERATOR = "generator", ALONE
    HELD = "held"
    HOLD_BACK = "hold-back"
    HTML = "html", ALONE
    INTO = "into"
    JSON = "json", ALONE
    JUNIT = "junit", ALONE
    LEAVE_OUT = "leave-out", ALONE
    LIKE = "like", ALONE
    LIMITS = "limits"
    LINEAR = "linear"
    METHOD = "method"
    MIN_DAMPING = "min-damping", "least_damping"
    MODE = "mode"
    MODELS = "models", ALONE
    MOVE_CONTROLS = "move-controls"
    NATIVE = "native"
    NO_CHECK = "no-check", ALONE
    NO_CSV = "no-csv", ALONE
    NO_LOAD_PARTS = "no-load-parts", ALONE
    NO_WIDENED_LIMITS = "no-widened-limits", ALONE
    ONLY = "only"
    OUT = "out", "folder"
    OUTAGES = "outages"
    PARAMETER = "parameter", "parameters"
    PARAMETERS = "parameters"
    PDF = "pdf", ALONE
    PER_UNIT = "per-unit", ALONE
    PLACE = "place", "places"
    POD = "pod"
    POINTS = "points"
    PORT = "port", ALONE
    PROTECTION = "protection"
    RANGE = "range", "frequencies"
    RANK = "rank", "ranked"
    RATING = "rating"
    REACTANCES = "reactances"
    REACTIVE_LIMITS = "reactive-limits", ALONE
    REFINE = "refine"
    REPLACE = "replace", ALONE
    RESUME = "resume", "checkpoints"
    RETUNE = "retune"
    REVOKED = "revoked"
    SCENARIO = "scenario"
    SCHEDULE = "schedule"
    SCHEDULER = "scheduler"
    SCR = "scr"
    SENSITIVITIES = "sensitivities", ALONE
    SET = "set", "values"
    SHARING = "sharing"
    SIGN = "sign"
    SIGNERS = "signers"
    SLACK = "slack", ALONE
    STAGES = "stages"
    STAND_IN = "stand-in"
    START = "start"
    STEP = "step"
    STOP = "stop"
    SWAP = "swap"
    TLS = "tls"
    TOLERANCE = "tolerance"
    TRANSFORMER = "transformer"
    TRIPS = "trips"
    TRUST_FMUS = "trust-fmus"
    TRY = "try", "steps"
    UNITS_CHECKED = "units-checked", ALONE
    UNTIL = "until"
    VARY = "vary"
    VOLTAGE = "voltage"
    WHOLE = "whole"
    WITH_LINEAR_MODEL = "with-linear-model", ALONE
    WORKERS = "workers"
    X_R = "x-r"

    def __new__(cls, name: str, keyword: str = "") -> Self:
        typed = f"--{name}"
        python = typed if keyword == ALONE else keyword or name.replace("-", "_")
        option = Spelling.__new__(cls, typed, python)
        option._value_ = typed
        return option

    __str__ = str.__str__
    __format__ = str.__format__  # type: ignore[assignment]  # as StrEnum has it

    @property
    def has_keyword(self) -> bool:
        """Return whether a function of Python takes it."""
        return self.python != self


_CALLS = {
    "run": "run",
    "modes": "modes",
    "export linear": "linearize",
    "sweep": "sweep",
    "sensitivities": "sensitivities",
    "interactions": "interactions",
    "site": "site",
    "screen": "screen",
    "design": "design",
    "fmu nyquist": "nyquist",
    "fmu admittance": "admittance",
    "fmu build": "build",
    "fmu check": "check",
}
"""Command → the function that Python has in its place."""

_TYPED = {Option.COMPONENT, Option.SET, Option.OUT, Option.POINTS}
"""Options that those functions lack, or have as an object's own: the command stays as it is typed."""


def command(words: str, *options: Option | tuple[Option, str]) -> Spelling:
    """Return a command in quotes, such as ``command("fmu check", (Option.ONLY, "binding"))``.

    Parameters
    ----------
    words
        The command and its arguments, in capitals, between ``gfor`` and the options.
    options
        Switches, and options with the value that they are given.
    """
    given = [one if isinstance(one, tuple) else (one, "") for one in options]
    typed = " ".join(["`gfor", words, *(f"{one.value} {value}".rstrip() for one, value in given)])
    name = " ".join(word for word in words.split() if word.islower())
    call = _CALLS.get(name)
    if call is None or any(one in _TYPED or not one.has_keyword for one, _ in given):
        return Spelling(f"{typed}`", f"{typed}`")  # Python has no such function: for a terminal
    keywords = [
        f"{one.python}={value!r}" if value else f"{one.python}=True" for one, value in given
    ]
    return Spelling(f"{typed}`", f"`{call}({', '.join(keywords)})`")
