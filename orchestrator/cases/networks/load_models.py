"""How loads follow voltage and frequency: each load's own keys, then those of ``[network.load_model]``, and parts of
constant impedance and current that a source tells apart."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fmus.grid.element_data import LAWS, Load, Zip
from orchestrator.cases.form.remedies import WITHOUT_PARTS
from orchestrator.cases.form.schema import LoadLaw, LoadModelTable, NetworkTable
from orchestrator.core.errors import InputError, Problem

_NAMES = {zip_: name for name, zip_ in LAWS.items()}
# of a part by the whole: above, the parts cancel, and the whole is none to take shares of
_LARGEST_SHARE = 100.0

# part of a load that its parts may leave over by rounding
_LITTLE = 1e-6

_OPEN = (
    "the load model is open: the file's loads (constant powers in its power flow) are taken as constant impedances, as "
    "ANDES does by itself (in eigenvalues since 1.9; before, they are constant powers there) and stability studies in "
    "PSS/E after a conversion to them; it can decide about the damping, "
    'so write which, such as load_model = { active = "power", reactive = "power" } in [network]; "impedance" and '
    '"current" are the others'
)


def is_open(table: NetworkTable | None) -> bool:
    """Return whether a network has another program's loads, and the case does not say how they follow the voltage."""
    if table is None or (table.raw or table.matpower or table.pandapower or table.cgmes) is None:
        return False
    return table.load_model.active is None and table.load_model.reactive is None


def as_powers(table: NetworkTable) -> NetworkTable:
    """The network with loads of constant power, where their model is open."""
    return table.model_copy(update={"load_model": LoadModelTable(active="power", reactive="power")})


def in_words(loads: list[Load]) -> str:
    active, reactive = {x.active for x in loads}, {x.reactive for x in loads if x.q_mvar}
    if len(active) > 1 or len(reactive) > 1:
        return "several models"
    (p,), q = active or {LAWS["impedance"]}, next(iter(reactive), None)
    return (
        f"constant {_name_of(p)}"
        if q in (None, p)
        else f"P constant {_name_of(p)}, Q constant {_name_of(q)}"
    )


def _name_of(law: Zip | None) -> str:
    return (
        "power"
        if law is None
        else _NAMES.get(law, f"{law.z:.3g} impedance, {law.i:.3g} current, {law.p:.3g} power")
    )


def is_told(load: Load, parts: tuple[complex, complex]) -> bool:
    """Return whether a source's constant impedances and currents [MW, Mvar] are the whole load, with nothing open."""
    rest = complex(load.p_mw, load.q_mvar) - sum(parts)
    return any(parts) and abs(rest) <= _LITTLE * max(map(abs, parts))


def open_question(
    table: NetworkTable | None, loads: Sequence[Load], told: Collection[str], place: str
) -> list[Problem]:
    """Ask how loads follow the voltage of which neither the case nor the source says it.

    ``told``: names of loads with a record, or with parts that are the whole load."""
    asked = is_open(table) and any(x.p_mw > 0 and x.name not in told for x in loads)
    return [Problem(place, _OPEN)] if asked else []


def device_laws(table: NetworkTable) -> LoadModelTable:
    """How a source's devices, such as DC lines, follow the voltage: constant powers where the case says nothing."""
    own = table.device_model
    return own.model_copy(
        update={"active": own.active or "power", "reactive": own.reactive or "power"}
    )


def with_laws(
    load: Load,
    table: NetworkTable,
    own: LoadModelTable | None = None,
    parts: tuple[complex, complex] = (0j, 0j),
) -> Load:
    """The load with its laws.

    Without a key, a load is a constant impedance, and static generation (P < 0) a constant current.

    ``own``: the load's own keys, which decide first.
    ``parts``: what of the load is a constant impedance and a constant current [MW, Mvar]; the keys are for the rest."""
    feeds = load.p_mw < 0
    models = [
        m for m in (own, table.generation_model if feeds else table.load_model) if m is not None
    ]
    usual: LoadLaw = "current" if feeds else "impedance"

    def first(key: str, otherwise: Any) -> Any:
        """The value of the first model that has one."""
        given = (getattr(model, key) for model in models)
        return next((value for value in given if value is not None), otherwise)

    active, reactive = (_law(first(key, usual)) for key in ("active", "reactive"))
    return replace(
        load,
        active=_mixed(load, "P", active, load.p_mw, (parts[0].real, parts[1].real)),
        reactive=_mixed(load, "Q", reactive, load.q_mvar, (parts[0].imag, parts[1].imag)),
        k_pf=first("k_pf", 0.0),
        k_qf=first("k_qf", 0.0),
        v_min=first("v_min", None),
        tau=first("tau", None),
    )


def _law(law: LoadLaw) -> Zip:
    return LAWS[law] if isinstance(law, str) else Zip(law.z, law.i, law.p)


@dataclass(frozen=True)
class FlowLaws:
    """How the powers of a load follow the voltage in a power flow, as its source tells them apart."""

    active: Zip
    reactive: Zip


def flow_laws(load: Load, parts: tuple[complex, complex]) -> FlowLaws:
    """The laws of a load of which constant impedances and currents are known [MW, Mvar]; the rest is a constant power.

    A power flow takes the rest as PSS/E does: a conversion of constant powers is for the dynamics alone."""
    rest = LAWS["power"]
    return FlowLaws(
        _mixed(load, "P", rest, load.p_mw, (parts[0].real, parts[1].real)),
        _mixed(load, "Q", rest, load.q_mvar, (parts[0].imag, parts[1].imag)),
    )


def _mixed(load: Load, quantity: str, rest: Zip, total: float, parts: tuple[float, float]) -> Zip:
    """The law of a load of which two parts are known; the rest follows a law of its own."""
    impedance, current = parts
    if not (impedance or current):
        return rest
    others = total - impedance - current
    if max(abs(impedance), abs(current), abs(others)) > _LARGEST_SHARE * abs(total):
        raise InputError(
            f"{load.name} at {load.bus}: its {quantity} is {total:g}, the sum of {others:g}, {current:g} of constant "
            f"current and {impedance:g} of constant impedance [MW, Mvar]; a load that cancels itself has no shares: "
            f"write {WITHOUT_PARTS}, or give the parts in [network.loads]"
        )
    z, i, p = (share / total for share in (impedance, current, others))
    return Zip(z + rest.z * p, i + rest.i * p, rest.p * p)
