"""PSS/E's CSVGN3 and CSVGN4: the static var compensator CSVGN1 with an override for large deviations of the voltage.

    v − V_ref → K·(1+sT_1)(1+sT_2)/((1+sT_3)(1+sT_4)) → within V_MIN and V_MAX → y_R
    y_R, or 1 if v − V_ref > V_OV, or R_MIN/S_n if v − V_ref < −V_OV → 1/(1+sT_5), within R_MIN/S_n and 1 → y
    B = (C_BASE − S_n·y)/S_n        [pu, S_n]

CSVGN4 differs in the bus whose voltage it measures. The override acts before the thyristors' lag, as PSS/E's CSVGN5
has it; iPSL's compensator of the Nordic 44 system has it behind the lag, which T_5 tells apart.

Sources: PowerWorld's guide to PSS/E's models for the fields, ANDES' table of PSS/E's models for what tells both apart,
iPSL's `Banks/PSSE/SVC/SVC.mo` for the override."""

from fmus.static_var.csvgn1 import S_N
from fmus.static_var.held_bus import holds_elsewhere
from fmus.static_var.reactor import overridden_susceptance
from fmus.static_var.susceptance import susceptance_model
from fmus.toolchain.model import Model


def csvgn3_phasor(records: str = "CSVGN3") -> Model:
    """The static var compensator with its override, phasor type.

    Parameters
    ----------
    records
        PSS/E's name of its record, CSVGN3 or CSVGN4; behind it the word ``elsewhere`` if it holds another bus'
        voltage.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    elsewhere = holds_elsewhere(records, ("CSVGN3", "CSVGN4"))
    title = "Static var compensator CSVGN3 or CSVGN4 of PSS/E (phasor type)"
    return susceptance_model(
        "csvgn3_phasor", title, S_N, overridden_susceptance, elsewhere=elsewhere
    )
