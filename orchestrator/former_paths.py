"""Names of modules before the rooms stood on floors: ``orchestrator.errors`` is `orchestrator.core.errors`.

They go on working, with a notice, for programs of others and for what was pickled. A finder at the end of Python's
list is asked only for modules that nothing else finds: imports of the present names do not pass here.
"""

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import CodeType, ModuleType

_ROOMS = {
    "core": "arrays asked closing cores errors foreign_files late safe_files spelling toml_files "
    "truth uncollected units",
    "devices": "acceptance binding fmi",
    "systems": "coupling ssp",
    "simulation": "federation interop watch",
    "output": "report results",
    "studies": "added black_box certification coordinated_design immittance interactions "
    "operating_points oscillations pod_design points screening sensitivities siting sweep",
    "face": "api cli explore",
}
"""Floor → its rooms and modules that stood directly in ``orchestrator``."""

_PARTED = {
    "analysis": {
        "core": "threads",
        "linear.models": "apart blocks component_linearization coupled_state delays device_start "
        "differences held_inputs hub_elimination linear_model linearization periodic perturbation "
        "remembered response_check sampled slope_linearization state_access state_space "
        "steady_state",
        "linear.spectra": "block_arnoldi continuation critical_modes growth_search mode_names "
        "mode_refinement mode_tracking modes presence real_schur shifted_equations stability",
        "linear.doubts": "coupled_response coupling_growth examination external_exciters linearity",
        "linear.signals": "ambient identification mode_doubts",
    },
    "study": {
        "studies.modes": "all_modes beside linear linear_model_files load_model_weight "
        "mode_identity modes naming request start_errors step_choice",
        "studies.runs": "after_events checkpoint_mark checkpoints files like mode_plots "
        "ring_down run run_request tables",
        "studies.signals": "ambient comparison measured signal_modes",
    },
}
"""Former room → present rooms → the modules that went there."""

_CASES = {
    "flow": "connected power_flow sharing flow_balance=balance flow_equations=equations "
    "flow_limits=limits flow_newton=newton",
    "form": "build_choices component_forms csv_rows definition devices given locate model_kinds "
    "names parameter_files remedies schema values",
    "networks": "areas branch_limits bus_loads cgmes element_names imported_flow kept_tables "
    "load_models matpower pandapower_json psse record_use source_changes source_ratings unit_row "
    "network_data=data network_import=conversion network_sources=sources flow_controls=controls",
    "questions": "contradictions idle_values mentions plausibility plausible_networks "
    "plausible_ranges plausible_sources plausible_values",
    "settings": "assignment imperfection_tables layers references",
    "events": "event_tables fault_tables islands",
    "scenario": "case_network catalogue_fmus facts flow_figures flow_units operating_point prepare "
    "run_plan scheduling service short_circuit start_values unit_tables wiring",
    "new": "new_case",
}
"""Room of the cases → the modules that stood beside it; ``former=present`` where the name changed as well."""

_RENAMED = {
    "systems.coupling.wires": "systems.coupling.imperfect_wires",
    "output.report.table": "output.report.column_table",
    "output.report.tables": "output.report.terminal_tables",
    "output.results.recorded": "output.results.recording_reader",
    "output.results.recording": "output.results.recording_writer",
    "output.results.storage": "output.results.file_writers",
    "cases.networks.psse.known_records": "cases.networks.psse.dyr_model_list",
    "cases.networks.psse.records": "cases.networks.psse.raw_records",
    "cases.networks.psse.records_of_units": "cases.networks.psse.dyr_unit_records",
    "cases.networks.psse.record_values": "cases.networks.psse.dyr_values",
    "cases.networks.psse.record_doubts": "cases.networks.psse.dyr_questions",
    "cases.networks.psse.record_catalogue": "cases.networks.psse.dyr_model_list",
    "face.explore.between": "face.explore.interpolation",
    "studies.validation.between": "studies.validation.between_samples",
    "output.results.columns": "output.results.xarray_columns",
    "studies.operating_points.columns": "studies.operating_points.point_columns",
}
"""Modules on the floors that had another name there."""

_OF_FMI = {
    "devices.sandbox": "answers=answer_forms confined=foreign_process confinement=access_restriction "
    "dll_process dll_reading=dll_reading_process dll_worker=dll_process_worker "
    "limits=resource_limits linux=kernel_calls mailbox process_tree protection=protections_in_force "
    "seccomp=system_call_filter supervisor wine wine_program",
    "devices.fmi": "bound=bound_component converted=converted_component "
    "devices=device_or_controller isolation=isolated_component "
    "isolation_worker=isolated_component_worker loaded=loaded_component port=port_mapping "
    "refusal=refused_calls turn=interpreter_turn",
    "core": "interrupts",
}
"""Present room → the modules that had another place or name in ``devices.fmi``; ``former=present`` where it changed."""

for _room, _names in _OF_FMI.items():
    for _name in _names.split():
        _former, _, _present = _name.partition("=")
        _RENAMED[f"devices.fmi.{_former}"] = f"{_room}.{_present or _former}"

_HERE = __package__


def present_name(name: str) -> str | None:
    """Return the present name of a module by its former one; the same for a room that was parted; None for others."""
    top, _, rest = name.partition(".")
    room, _, inside = rest.partition(".")
    if top != _HERE:
        return None
    if rest in _RENAMED:
        return f"{_HERE}.{_RENAMED[rest]}"
    if room in _PARTED and not inside:
        return name
    if room in _PARTED:
        homes = [home for home, names in _PARTED[room].items() if inside in names.split()]
        return f"{_HERE}.{homes[0]}.{inside}" if homes else None
    if room == "cases":
        return _present_case_module(inside)
    floors = [floor for floor, rooms in _ROOMS.items() if room in rooms.split()]
    if not floors:
        return None
    inside_floor = f"{floors[0]}.{rest}"
    return f"{_HERE}.{_RENAMED.get(inside_floor, inside_floor)}"


def _present_case_module(inside: str) -> str | None:
    """Return the present name of a module that stood directly in the folder of the cases, or in a room there."""
    module, _, rest = inside.partition(".")
    for room, names in _CASES.items():
        for name in names.split():
            former, _, present = name.partition("=")
            if former == module:
                on_floor = ".".join(filter(None, ("cases", room, present or former, rest)))
                return f"{_HERE}.{_RENAMED.get(on_floor, on_floor)}"
    return None


_IMPORTERS = (__name__, f"{_HERE}.devices.fmi.brought_modules", "importlib._bootstrap")
"""Modules between a line that imports and this one: the second while an FMU that brings modules lives."""


def _notice(former: str, present: str) -> None:
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__") in _IMPORTERS:
        frame = frame.f_back
    warnings.warn_explicit(
        f"{former} is now {present}; import it there",
        DeprecationWarning,
        frame.f_code.co_filename,
        frame.f_lineno,
        frame.f_globals.get("__name__"),
        frame.f_globals.setdefault("__warningregistry__", {}),
    )


class _Room(ModuleType):
    """A room under its former name: it holds no module, and looks its names up in the present room."""

    def __getattr__(self, name: str) -> object:
        present = present_name(self.__name__)
        if name.startswith("__") or present in (None, self.__name__):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        assert present is not None
        value: object = getattr(import_module(present), name)
        _notice(f"{self.__name__}.{name}", f"{present}.{name}")
        return value


class _Former:
    """Gives the present module under its former name: one module, not a second copy with classes of its own.

    Like the finder, it has no base class of `importlib.abc`, which imports what reads e-mail: 13 of the 15 ms that this
    package would take to import.
    """

    def __init__(self, former: str, present: str, room: bool) -> None:
        self._former, self._present, self._room = former, present, room
        self._spec: ModuleSpec | None = None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        if self._room:
            return _Room(spec.name)
        module = import_module(self._present)
        self._spec = module.__spec__  # which the import system is about to replace
        return module

    def exec_module(self, module: ModuleType) -> None:
        if not self._room:
            module.__spec__ = self._spec

    def get_code(self, _: str) -> CodeType | None:
        """Return the code, for ``python -m`` with the former name."""
        spec = find_spec(self._present)
        loader = spec.loader if spec is not None else None
        code: CodeType | None = loader.get_code(self._present) if loader is not None else None  # type: ignore[attr-defined]
        return code


class FormerPaths:
    """Finds modules by their former names."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        present = present_name(fullname)
        if present is None:
            return None
        if present == fullname:  # a room that was parted
            parted = _Former(fullname, present, room=True)
            return ModuleSpec(fullname, parted, is_package=True)  # type: ignore[arg-type]
        found = find_spec(present)
        if found is None:
            return None
        room = found.submodule_search_locations is not None
        if not room:
            _notice(fullname, present)
        loader = _Former(fullname, present, room)
        return ModuleSpec(fullname, loader, origin=found.origin, is_package=room)  # type: ignore[arg-type]


def install() -> None:
    """Let former names be found, after all others."""
    if not any(isinstance(finder, FormerPaths) for finder in sys.meta_path):
        sys.meta_path.append(FormerPaths())
