"""Words on the devices of a PSS/E file that our network has as loads."""

from collections.abc import Collection

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.psse.device_flow import SolvedDevices
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.cases.networks.source_changes import Changes
from orchestrator.core.errors import Problem, few, number_of

_SHOWN = (
    3  # devices of a kind whose powers a question tells; the records (--details) have the others
)
_NAMES = {
    "two-terminal dc": "two-terminal DC line",
    "vsc dc line": "VSC DC line",
    "multi-terminal dc": "multi-terminal DC network",
    "facts device": "FACTS device",
    "induction machine": "induction machine",
    "gne": "GNE device",
}
_OPEN = (
    ". How they follow the voltage is open: constant powers are taken, which fast controls of DC lines give; it can "
    'decide about the damping, so write which, such as device_model = { active = "power", reactive = "power" } in '
    '[network]; "current" and "impedance" are the others'
)


def device_notes(
    solved: SolvedDevices, table: NetworkTable, place: str, modelled: Collection[HeldDevice] = ()
) -> list[Problem]:
    """Return a row for each kind of device with what they feed and draw, and one for each kind of doubt.

    ``modelled``: devices with a model of their own, which are no loads."""
    changes = Changes(place)
    is_open = table.device_model.active is None or table.device_model.reactive is None
    for section, name in _NAMES.items():
        own = {
            device: text
            for device, text in solved.words
            if device.section == section and device not in modelled
        }
        if not own:
            continue
        shown = few(own.values(), _SHOWN, "; ")
        text = f"{number_of(len(own), name)} without dynamics, at the solved powers: {shown}"
        for device in own:
            changes.note(device.line, text + (_OPEN if is_open else ""))
    for device, doubt in dict.fromkeys(solved.doubts):
        changes.note(device.line, doubt)
    return changes.as_problems()
