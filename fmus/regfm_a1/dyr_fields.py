"""Record REGFMA1 of a PSS/E dynamics file (DYR) → parameters of `regfm_a1_phasor`.

Field names are the specification's. Source of their order: PSS/E 36.4's integers VFlag and QVFlag and its constants 1
to 18, as public scripts for PSS/E number them and GridPACK's reader takes them. RL and XL are no fields: they are
ZSORCE of the network data. Per unit values are on MBASE."""

from fmus.synchronous_generator.dyr_fields import DyrField, DyrRecord

_SAME = (
    "TPf", "TQf", "TVf", "ImaxF", "Emax", "Emin", "Pmax", "Pmin", "Qmax", "Qmin", "mp", "mq", "kppmax", "kipmax",
    "kpqmax", "kiqmax", "kpv", "kiv",
)  # fmt: skip

REGFM_A1_RECORDS: dict[str, DyrRecord] = {
    "REGFMA1": DyrRecord(
        "converter",
        "regfm_a1_phasor",
        (
            DyrField("VFlag", ("VFlag",), only=(0.0, 1.0), switch=True),
            DyrField("QVFlag", only=(0.0, 1.0)),  # which reference a plant controller sets: here all can be set
            *(DyrField(name, (name,)) for name in _SAME),
        ),
    )
}
"""By PSS/E's name: the kind ``converter`` is a whole component, and ``part`` its model."""
