"""How loads follow voltage and frequency: each load's own keys, then those of ``[network.load_model]``."""

from dataclasses import replace

from fmus.grid.element_data import LAWS, Load, Zip
from orchestrator.cases.schema import LoadLaw, LoadModelTable, NetworkTable


def with_laws(load: Load, table: NetworkTable, own: LoadModelTable | None = None) -> Load:
    """The load with its laws.

    Without a key, a load is a constant impedance, and static generation (P < 0) a constant current.

    Parameters
    ----------
    load
        Its name, bus and power.
    table
        The network, with the models of all loads and of all static generation.
    own
        The load's own keys, which decide first.
    """
    feeds = load.p_mw < 0
    models = [m for m in (own, table.generation_model if feeds else table.load_model) if m is not None]
    usual: LoadLaw = "current" if feeds else "impedance"
    return replace(
        load,
        active=_law(next((m.active for m in models if m.active is not None), usual)),
        reactive=_law(next((m.reactive for m in models if m.reactive is not None), usual)),
        k_pf=next((m.k_pf for m in models if m.k_pf is not None), 0.0),
        k_qf=next((m.k_qf for m in models if m.k_qf is not None), 0.0),
        v_min=next((m.v_min for m in models if m.v_min is not None), None),
        tau=next((m.tau for m in models if m.tau is not None), None),
    )


def _law(law: LoadLaw) -> Zip:
    return LAWS[law] if isinstance(law, str) else Zip(law.z, law.i, law.p)
