"""Components in the place of loads that are motors by their records of dynamics data."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.draft import Draft, UnitOrigin
from orchestrator.cases.form.schema import ComponentTable, UnitsTable
from orchestrator.cases.networks.psse.dyr_records import DynamicRecord
from orchestrator.cases.networks.psse.motor_loads import (
    MotorLoad,
    loads_without,
    motor_loads,
    motor_remarks,
)

_PHASOR = "_phasor"  # end of the names of phasor models, which motors are alone
_COMMON = "converter_parameters"  # key of [units] with values of units, of which a motor takes none


def take_motors(
    draft: Draft, table: UnitsTable, records: Sequence[DynamicRecord]
) -> Sequence[MotorLoad]:
    """Take loads with a record of a motor out of the network, and return the motors; none among EMT models."""
    data = draft.data
    if data is None or not table.generator.endswith(_PHASOR):
        return ()
    left = {name.upper() for name in table.dyr_leave_out}
    wanted = [record for record in records if record.name not in left]
    motors = motor_loads(wanted, data.file_loads, data.loads)
    if not motors:
        return ()
    load_mw = sum(load.p_mw for load in data.loads if load.p_mw > 0)
    draft.found.questions += motor_remarks(motors, load_mw)
    taken = [motor.load for motor in motors]
    draft.data = replace(
        data,
        loads=tuple(loads_without(data.loads, motors)),
        file_loads=tuple(load for load in data.file_loads if load not in taken),
    )
    return motors


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
