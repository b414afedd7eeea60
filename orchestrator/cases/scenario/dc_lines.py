"""DC lines with models: their stations as components, the connections of these, and their operating point."""

from collections.abc import Collection, Iterator, Sequence

from orchestrator.cases.draft import Draft, UnitOrigin
from orchestrator.cases.form.schema import ComponentTable, UnitsTable
from orchestrator.cases.networks.psse.dc_line_models import (
    StationOfLine,
    modelled_lines,
    named_lines,
    remarks_of_lines,
)
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.systems.coupling.system import ComponentPlan, System

_PHASOR = "_phasor"  # end of the names of phasor models, which the stations are alone
_COMMON = (
    "converter_parameters"  # key of [units] with values of units, of which a station takes none
)
_TO_RECTIFIER = ("V_most", "drop", "v", "beyond")
"""Outputs of an inverter, and behind `_AT_RECTIFIER` the inputs of its rectifier."""

_AT_RECTIFIER = "inverter."
_TO_INVERTER = {"inverter_I": "I_dc", "inverter_V": "V_dc"}
"""Outputs of a rectifier and the inputs of its inverter."""

_APART = 1e-3  # part of a power by which both ends may differ from what the line brings


def names_of_lines(draft: Draft, records: Sequence[DynamicRecord]) -> frozenset[str]:
    """Return the names of DC lines that become models; none among EMT models."""
    units = draft.given.case.units
    if units is None or not units.generator.endswith(_PHASOR):
        return frozenset()
    return named_lines(records)


def take_dc_lines(
    draft: Draft, table: UnitsTable, records: Sequence[DynamicRecord]
) -> frozenset[tuple[str, int]]:
    """Give the draft its DC lines with models; return the places of their records.

    ``records``: without those that the case leaves out."""
    data = draft.data
    if data is None or not table.generator.endswith(_PHASOR):
        return frozenset()
    draft.dc_lines = modelled_lines(records, data.dc_lines)
    draft.found.questions += remarks_of_lines(draft.dc_lines)
    return frozenset((one.record.file, one.record.line) for one in draft.dc_lines)


def dc_components(draft: Draft) -> dict[str, ComponentTable]:
    """Return a component for each station, with the line of the record that gives its parameters."""
    found = {}
    for one in draft.dc_lines:
        for station in (one.rectifier, one.inverter):
            values = dict(station.parameters)
            found[station.name] = ComponentTable(
                model=station.model,
                bus=station.bus,
                parameters=values,
                inputs=_constant_inputs(station),
                records=station.records,
            )
            lines = dict.fromkeys(values, one.record.line)
            origin = UnitOrigin(one.record.file, frozenset(values), _COMMON, lines)
            draft.origins[station.name] = origin
    draft.known |= {*found}
    return found


def dc_sources(draft: Draft) -> Iterator[tuple[str, str, str]]:
    """Yield outputs, the inputs that they feed, and the place of the record that says so."""
    for one in draft.dc_lines:
        rectifier, inverter = one.rectifier.name, one.inverter.name
        if not {rectifier, inverter} <= {*draft.system.components}:
            continue
        for name in _TO_RECTIFIER:
            yield f"{inverter}.{name}", f"{rectifier}.{_AT_RECTIFIER}{name}", one.record.place
        for output, target in _TO_INVERTER.items():
            yield f"{rectifier}.{output}", f"{inverter}.{target}", one.record.place


def check_dc_lines(draft: Draft) -> None:
    """Note a line whose ends are not set to what it brings from one to the other."""
    plans = draft.system.components
    for one in draft.dc_lines:
        ends = (one.rectifier.name, one.inverter.name)
        if not {*ends} <= {*plans}:
            continue
        wanted, found = _power_sent(plans[ends[0]]), _power_fed(plans[ends[1]])
        kilovolts = [plans[name].number("V_dc_0") for name in ends]
        if not wanted and not found:  # both are out of service
            continue
        apart = abs(wanted - found) / max(abs(wanted), abs(found))
        if max(apart, abs(kilovolts[0] / kilovolts[1] - 1)) > _APART:
            text = (
                f"{ends[0]} sends {wanted:.4g} MW at V_dc_0 = {kilovolts[0]:.4g} kV, and {ends[1]} feeds {found:.4g} "
                f"MW at {kilovolts[1]:.4g} kV: a DC line cannot start so; set P_0 and V_dc_0 of both, "
                "or take both out of service"
            )
            draft.note(draft.place_of_component(ends[0]), text)


def _power_fed(plan: ComponentPlan) -> float:
    """Return the power that an inverter feeds [MW]."""
    return plan.number("P_0") * plan.number("S_n")


def _power_sent(rectifier: ComponentPlan) -> float:
    """Return the power that a line brings to its inverter [MW]."""
    drawn, V = -_power_fed(rectifier), rectifier.number("V_dc_0")
    current = 2 * drawn / (V + (V**2 + 4 * rectifier.number("R_dc") * drawn) ** 0.5)
    return float(V * current)


def _constant_inputs(station: StationOfLine) -> dict[str, float]:
    """Return what the inputs of a station are held at whose bus is beyond what is studied."""
    return {} if station.held is None else {"v_re": station.held.real, "v_im": station.held.imag}


def other_stations(system: System, units: Collection[str]) -> dict[str, str]:
    """Return the stations of DC lines among units, each with the one at its other end.

    Two units that feed each other are such stations."""
    fed = {(c.source.component, c.target.component) for c in system.connections}
    both = [(one, other) for one, other in sorted(fed) if (other, one) in fed]
    return {one: other for one, other in both if one in units and other in units}
