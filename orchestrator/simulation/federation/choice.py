"""Figures and names that all processes of a federation share."""

from orchestrator.simulation.federates import Federates, address_of

OWN_NAME = "gfor_cosim"  # name of the federate of gfor itself
OVER = "the run is over"
"""Reason with which gfor ends a federation at a broker that is not its own: otherwise time goes on without it."""

PROTOCOL = 1  # changes whenever a federate of the version before would misunderstand
FIRST_NS = 1  # when gfor reads what federates published before their first step [ns]

__all__ = [
    "FIRST_NS",
    "OVER",
    "OWN_NAME",
    "PROTOCOL",
    "Federates",
    "address_of",
]
