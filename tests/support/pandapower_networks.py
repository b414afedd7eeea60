"""pandapower's networks for its own power flow."""

from typing import Any

from tests.support.late import LateLibrary

networks = LateLibrary("pandapower.networks")


def pandapower_network(name: str) -> Any:
    """As the file has it: the tables that later versions added are empty, and adding them takes half of the time."""
    return getattr(networks, name)(convert=False)
