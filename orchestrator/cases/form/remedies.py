"""Remedies that stand in messages: a key of a case, and the option of ``gfor new`` that writes it into a new one."""

from collections.abc import Sequence

from orchestrator.core.options import Option, command


def without_kinds(kinds: Sequence[str]) -> str:
    """Return ``leave_out = ['gne'] in [network] (`gfor new --leave-out "gne"`)``, without the devices of some kinds."""
    options = [(Option.LEAVE_OUT, f'"{kind}"') for kind in kinds]
    return f"leave_out = {_toml_list(kinds)} in [network] (" + command("new", *options) + ")"


def without_models(names: Sequence[str]) -> str:
    """Return the same for records of dynamics data, by the names of their models."""
    options = [(Option.DYR_LEAVE_OUT, _quoted(name)) for name in names]
    return f"dyr_leave_out = {_toml_list(names)} in [units] (" + command("new", *options) + ")"


def replacement_of(unit: str) -> str:
    """Return what puts a converter of the case in the place of a machine, by the label of its unit."""
    return replacements_of([unit])


def replacements_of(units: Sequence[str]) -> str:
    """Return the same for several machines."""
    typed = command("new", *((Option.REPLACE, _quoted(unit)) for unit in units))
    return f"replace = {_toml_list(units)} in [units] (" + typed + ")"


def with_frequency(hertz: float) -> str:
    """Return what gives a network's rated frequency [Hz]."""
    typed = command("new", (Option.FREQUENCY, f'"{hertz:g} Hz"'))
    return f'frequency = "{hertz:g} Hz" in [network] (' + typed + ")"


def with_slack(name: str) -> str:
    """Return what names the unit or bus that feeds what is left."""
    return f'slack = "{name}" in [power_flow] (' + command("new", (Option.SLACK, name)) + ")"


APPROXIMATING = "dyr_approximate = true in [units] (`gfor new --dyr-approximate`)"
WITHOUT_PARTS = "keep_load_parts = false in [network] (`gfor new --no-load-parts`)"
KEEPING_LIMITS = "reactive_limits = true in [power_flow] (`gfor new --reactive-limits`)"


def _quoted(word: str) -> str:
    """Return a value of an option as it is typed."""
    return f'"{word}"' if " " in word else word


def _toml_list(names: Sequence[str]) -> str:
    return f"[{', '.join(map(repr, names))}]"
