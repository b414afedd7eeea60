"""The parts of each machine and their parameters, as records of dynamics data say them one by one."""

from collections.abc import Collection, Sequence

from fmus.grid_following.dyr_approximation import FIELDS
from fmus.synchronous_generator.dyr_records import WITHOUT_REFERENCE
from fmus.toolchain.dyr_form import DyrRecord
from orchestrator.cases.form.remedies import without_models
from orchestrator.cases.networks.psse.dyr_file import (
    DynamicRecord,
    refuse_next,
    swallowed_machines,
)
from orchestrator.cases.networks.psse.dyr_mistakes import remedy_for
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.dyr_values import values_of_record
from orchestrator.cases.networks.psse.machine_model import (
    CLASSICAL,
    OF_PLANTS,
    WITHOUT_INERTIA,
)
from orchestrator.cases.networks.psse.missing_models import kind_of
from orchestrator.cases.networks.psse.raw_network import Machine, unit_labels
from orchestrator.core.errors import InputError

_MODELS = {*RECORDS_OF_UNITS, *FIELDS}
"""Names of the models that a record without a slash may run into."""

_NEEDED = ("machine", "converter", "electrical")
"""Kinds of records that a machine or a converter cannot do without."""

MachineKey = tuple[int, str]
"""Bus and identifier of a machine."""


class PartsOfMachines:
    """Parts and parameters of machines, and what is wrong with their records.

    ``parts``, ``names``: our part and PSS/E's record by the kind of part. ``values``, ``lines``: of parameters.
    ``records``: of each machine, all of them. ``problems``: in the order of the file. ``first_places``: of the first
    record, by the problem. ``without``: names of converters' records, which have a remedy of their own. ``lacking``:
    machines whose own record no part stands for, or is lost in another without a slash. ``unread``: records whose
    values are wrong. ``may_go``: whether a record that is in the way may be left out."""

    def __init__(
        self, machines: Sequence[Machine], left: Collection[str], *, approximate: bool
    ) -> None:
        self.machines = {(machine.bus, machine.name.strip()): machine for machine in machines}
        self.labels = unit_labels(machines)
        self.approximate = approximate
        self._left = left
        self.parts: dict[MachineKey, dict[str, str]] = {key: {} for key in self.machines}
        self.names: dict[MachineKey, dict[str, str]] = {key: {} for key in self.machines}
        self.values: dict[MachineKey, dict[str, float]] = {key: {} for key in self.machines}
        self.lines: dict[MachineKey, dict[str, int]] = {key: {} for key in self.machines}
        self.records: dict[MachineKey, list[DynamicRecord]] = {key: [] for key in self.machines}
        self.problems: list[str] = []
        self.first_places: dict[str, str] = {}
        self.without: set[str] = set()
        self.lacking: set[MachineKey] = set()
        self.unread: list[DynamicRecord] = []
        self.may_go = False

    def take(self, record: DynamicRecord) -> None:
        """Take a record of a machine in service; others, and models that are left out, set nothing."""
        key = (record.bus, record.machine)
        self._note_swallowed(record)
        if key not in self.machines:
            return
        self.records[key].append(record)
        if record.name in self._left or (self.approximate and record.name in FIELDS):
            return
        is_left = self.approximate and record.name in OF_PLANTS
        known = None if is_left else RECORDS_OF_UNITS.get(record.name)
        if known is None:
            self._note_unknown(record, key)
        elif known.kind in self.parts[key]:
            self._note_second(record, key, known.kind)
        else:
            self._set_part(record, key, known)

    def _note_swallowed(self, record: DynamicRecord) -> None:
        """Note a record in which those of machines in service are lost, whatever else becomes of it."""
        lost = {*swallowed_machines(record, _MODELS)} & {*self.machines}
        self.lacking |= lost
        try:
            refuse_next(record, _MODELS if lost else ())
        except InputError as error:
            self.problems.append(str(error))

    def _note_second(self, record: DynamicRecord, key: MachineKey, kind: str) -> None:
        """Note a record of a kind that the machine has one of already; one of another model may be left out."""
        name = self.names[key][kind]
        first = next(one for one in self.records[key] if one.name == name)
        # a name with the bus is of this record only, where the machine is alone at its bus
        is_alone = self.labels[key] == str(record.bus)
        remedy = "remove one"
        if record.name != name and is_alone:
            remedy = f"remove one, or write {without_models([f'{record.name} at {record.bus}'])}"
        self.problems.append(
            f"{record.place}: a second {kind} of machine {record.machine!r} at bus {record.bus}; the first is {name} "
            f"in line {first.line}; {remedy}"
        )

    def _note_unknown(self, record: DynamicRecord, key: MachineKey) -> None:
        """Note a record that no part stands for, where it has a remedy of its own."""
        remedy = remedy_for(record.name, self.labels[key], approximate=self.approximate)
        if not remedy:
            return
        problem = f"no part of ours stands for {record.name}{remedy}"
        self.problems.append(problem)
        self.first_places.setdefault(problem, record.place)
        self.without.add(record.name)
        if kind_of(record.name) == "converter":
            self.lacking.add(key)

    def _set_part(self, record: DynamicRecord, key: MachineKey, known: DyrRecord) -> None:
        self.parts[key][known.kind] = known.part
        self.names[key][known.kind] = record.name
        try:
            own = values_of_record(record, known)
        except InputError as error:
            self.problems.append(str(error))
            self.unread.append(record)
            self.may_go |= known.kind not in _NEEDED
            return
        self.values[key] |= own
        self.lines[key] |= dict.fromkeys(own, record.line)

    def give_infinite_machines(self) -> None:
        """Give machines that the network calls infinite, and that have no record, a classical one without inertia."""
        for key, machine in self.machines.items():
            if machine.is_infinite and not self.records[key]:
                self.parts[key]["machine"] = CLASSICAL
                self.values[key] |= WITHOUT_INERTIA

    def give_load_controllers(self) -> None:
        """Give governors the slow loops around them that records say; one without a governor to move is a problem."""
        for key, parts in self.parts.items():
            end = parts.pop("supervisor", None)
            if end is None:
                continue
            governor = parts.get("governor", "")
            if governor and governor not in WITHOUT_REFERENCE:
                parts["governor"] = f"{governor}_{end}"
                continue
            name = self.names[key]["supervisor"]
            record = next(one for one in self.records[key] if one.name == name)
            whose = (
                f"{self.names[key]['governor']} has none" if governor else "it has no record of one"
            )
            self.problems.append(
                f"{record.place}: {name} moves the power reference of the governor of machine {record.machine!r} at "
                f"bus {record.bus}, and {whose}; write {without_models([name])}"
            )

    def is_open(self, key: MachineKey) -> bool:
        """Return whether a record of a machine is left out."""
        return any(record.name in self._left for record in self.records[key])
