"""Zero-sequence impedances of transformers by their vector group.

    YNyn         z + 3·z_n of both neutrals, from one side to the other
    YNd, Dyn     z + 3·z_n, from the side of the star to earth; the side of the delta has no path
    all others   no path

A transformer with three windings is three legs to a star point: an earthed star joins its bus to that point, a delta
joins the point to earth, and a star without earth is open.

Source: C. F. Wagner and R. D. Evans, Symmetrical Components, 1933."""

from fmus.grid.element_data import Line
from fmus.grid.network import Network
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.sequence_impedances import SequenceNetwork
from orchestrator.cases.form.schema import SequencesTable
from orchestrator.cases.networks import sequence_data as usual
from orchestrator.cases.networks.sequence_data import (
    DELTA,
    EARTHED,
    ZeroTransformer,
    windings_of,
)


def add_transformer(zero: SequenceNetwork, branch: FlowLine, known: ZeroTransformer) -> None:
    """Add a transformer, or one leg of it, to a zero-sequence network by the connections of its windings."""
    one, other, square = branch.from_bus, branch.to_bus, branch.tap**2
    if len(known.windings) == 1:  # a leg to the star point of three windings
        z = known.z + 3 * known.earthing[0] / square
        if known.windings[0] == EARTHED:
            zero.add_series(one, other, z, branch.tap)
        elif known.windings[0] == DELTA:
            zero.add_to_earth(other, 1 / z)
        return
    first, second = (winding == EARTHED for winding in known.windings[:2])
    z_first, z_second = 3 * known.earthing[0] / square, 3 * known.earthing[1]
    if first and second:
        zero.add_series(one, other, z_first + known.z + z_second, branch.tap)
    elif first and known.windings[1] == DELTA:
        zero.add_to_earth(one, 1 / (z_first + known.z) / square)
    elif second and known.windings[0] == DELTA:
        zero.add_to_earth(other, 1 / (known.z + z_second))


def usual_transformer(
    network: Network, line: Line, z: complex, table: SequencesTable
) -> tuple[ZeroTransformer, str]:
    """Return a transformer by its vector group in the case, or by the usual one.

    Parameters
    ----------
    z
        Its impedance in the positive sequence [pu, 100 MVA].

    Returns
    -------
    tuple
        The transformer, and the key of the case that would have told its group; "" if nothing was missing."""
    z *= table.transformer_x0 or usual.TRANSFORMER_X0
    given = table.groups.get(line.name)
    if given is not None:
        return ZeroTransformer(windings_of(given), z), ""
    side = unit_side(network, line)
    if side is None:
        windings = windings_of(table.transformers or usual.NETWORK_TRANSFORMER)
        return ZeroTransformer(windings, z), "transformers" if table.transformers is None else ""
    windings = windings_of(table.step_up or usual.STEP_UP)
    return (
        ZeroTransformer(windings if side == 1 else windings[::-1], z),
        "step_up" if table.step_up is None else "",
    )


def usual_leg(
    transformer: str, leg: int, z: complex, table: SequencesTable
) -> tuple[ZeroTransformer, str]:
    """Return one leg of a transformer with three windings, numbered from 1, and the key that was missing, as above."""
    given = table.groups.get(transformer)
    windings = windings_of(given or usual.THREE_WINDINGS)
    own = windings[leg - 1 : leg] or (DELTA,)
    known = ZeroTransformer(own, z * (table.transformer_x0 or usual.TRANSFORMER_X0))
    return known, "groups" if given is None else ""


def unit_side(network: Network, line: Line) -> int | None:
    """Return the end, 0 or 1, at which units stand and no other branch; None where there is none."""
    units = {port.bus for port in network.ports}
    for k, bus in enumerate((line.from_bus, line.to_bus)):
        others = [x for x in network.lines if bus in (x.from_bus, x.to_bus)]
        if bus in units and len(others) == 1:
            return k
    return None


def has_delta_at_network(network: Network, line: Line, known: ZeroTransformer) -> bool:
    """Return whether a transformer at a unit has its delta at the network's side and is earthed at the unit's."""
    side = unit_side(network, line)
    if side is None or len(known.windings) != 2:
        return False
    return known.windings[side] == EARTHED and known.windings[1 - side] == DELTA
