"""Components in the place of loads that are motors by their records of dynamics data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from orchestrator.cases.draft import Draft, UnitOrigin
from orchestrator.cases.form.schema import ComponentTable, UnitsTable
from orchestrator.cases.networks.load_models import is_open
from orchestrator.cases.networks.psse.composite_loads import (
    CompositeLoads,
    composite_loads,
    composite_remarks,
)
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.load_records import with_recorded_laws
from orchestrator.cases.networks.psse.motor_loads import (
    MotorLoad,
    loads_without,
    motor_loads,
    motor_remarks,
)
from orchestrator.cases.networks.psse.refusals import Refusals

_PHASOR = "_phasor"  # end of the names of phasor models, which motors are alone
_COMMON = "converter_parameters"  # key of [units] with values of units, of which a motor takes none


@dataclass(frozen=True)
class Motors:
    """Motors in the place of loads, and places of the records that they are of."""

    loads: Sequence[MotorLoad] = ()
    places: frozenset[tuple[str, int]] = frozenset()


def take_motors(draft: Draft, table: UnitsTable, records: Sequence[DynamicRecord]) -> Motors:
    """Take loads with a record of a motor out of the network, and return the motors; none among EMT models.

    What a composite load has beside its motors stays a load, with the law of its record."""
    data = draft.data
    if data is None or not table.generator.endswith(_PHASOR):
        return Motors()
    left = {name.upper() for name in table.dyr_leave_out}
    wanted = [record for record in records if record.name not in left]
    motors, composite, refusals = list[MotorLoad](), CompositeLoads((), {}, ()), Refusals()
    with refusals.keep():
        motors = motor_loads(wanted, data.file_loads, data.loads)
    alone = [motor.load for motor in motors]
    rest = [load for load in data.file_loads if load not in alone]
    with refusals.keep():
        composite = composite_loads(wanted, rest, data.loads)
    refusals.tell()
    if not motors and not composite.records:
        return Motors()
    load_mw = sum(load.p_mw for load in data.loads if load.p_mw > 0)
    draft.found.questions += [*motor_remarks(motors, load_mw), *composite_remarks(composite)]
    everything = (*motors, *composite.motors)
    without = loads_without(data.loads, everything)
    laws = composite.laws if is_open(draft.given.case.network) else {}
    elements = [
        with_recorded_laws(load, laws[load.name]) if load.name in laws else load for load in without
    ]
    others = [load for load in rest if load.load not in composite.laws]
    draft.data = replace(
        data,
        loads=tuple(elements),
        file_loads=tuple(others),
        recorded_loads=data.recorded_loads | {*laws},
    )
    used = [*(motor.record for motor in motors), *composite.records]
    return Motors(everything, frozenset((record.file, record.line) for record in used))


def motor_components(draft: Draft, motors: Sequence[MotorLoad]) -> dict[str, ComponentTable]:
    """Return a component for each motor, with the lines of the records that give its parameters."""
    found = {}
    for motor in motors:
        found[motor.name] = ComponentTable(
            model=motor.model, bus=motor.bus, parameters=dict(motor.parameters)
        )
        lines = dict.fromkeys(motor.parameters, motor.record.line)
        own = frozenset(motor.parameters)
        draft.origins[motor.name] = UnitOrigin(motor.record.file, own, _COMMON, lines)
    draft.known |= {*found}
    return found
