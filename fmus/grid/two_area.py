"""The two-area synthetic system: SG1 and the converter at bus 2, SG2 at bus 3, one line between them.

Source: Norma técnica de supervisión 631 v2.0 (2020), tables 40-47, with the converter of
Mateu-Barriendos et al. 2024. The step-up transformers belong to the devices, so buses 1, 4 and 5
are inside them."""

from dataclasses import replace

from fmus.grid.network import Line, Load, Network, Port
from fmus.toolchain.model import Model

TWO_AREA = Network(
    name="two_area_grid",
    buses=("bus_2", "bus_3"),
    lines=(Line("L", "bus_2", "bus_3", X=0.1),),
    loads=(Load("load_2", "bus_2", p_mw=2600.0), Load("load_3", "bus_3", p_mw=4000.0)),
    ports=(Port("sg1", "bus_2"), Port("sg2", "bus_3"), Port("gfor", "bus_2")),
)

TWO_AREA_PHASOR = replace(TWO_AREA, name="two_area_phasor_grid")


def two_area_grid(network: Network = TWO_AREA) -> Model:
    """EMT line and constant-impedance loads of the two-area system."""
    from fmus.grid.grid import grid  # noqa: PLC0415 - a network is read without equations

    return grid(network)


def two_area_phasor_grid(network: Network = TWO_AREA_PHASOR) -> Model:
    """The same without network transients."""
    from fmus.grid.phasor_grid import phasor_grid  # noqa: PLC0415 - as above

    return phasor_grid(network)
