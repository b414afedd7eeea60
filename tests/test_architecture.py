"""Who may import whom, and a few habits that a reader relies on."""

import ast
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from orchestrator.studies.points.code import code_files, needed_modules
from tests.support.all_code import asked_of_all_code
from tests.support.source_files import product_files

ROOT = Path(__file__).parents[1]
PACKAGES = ("fmus", "gfor_fmu", "orchestrator")

FLOORS = {
    "core": (
        (
            "arrays",
            "closing",
            "cores",
            "late",
            "read_only",
            "given_files",
            "interrupts",
            "spelling",
            "threads",
            "uncollected",
            "units",
        ),
        ("assignment", "bisection", "options"),
        ("errors",),
        ("asked", "attributes", "foreign_files", "question_kinds"),
        ("file_hashes", "safe_files", "toml_files", "truth"),
    ),
    "devices": (("sandbox",), ("fmi",), ("binding",), ("acceptance",)),
    "systems": (("coupling",), ("ssp",)),
    "linear": (("models",), ("spectra",), ("doubts", "signals")),
    "cases": (
        ("flow",),
        ("form",),
        ("networks",),
        ("draft",),
        ("questions",),
        ("settings",),
        ("events",),
        ("scenario",),
        ("case",),
        ("built_in", "forcing", "new", "use"),
    ),
    "simulation": (
        ("waiting_times",),
        ("federates",),
        ("engine",),
        ("federation", "interop", "watch"),
    ),
    "output": (("results", "signatures"), ("report",)),
    "studies": (
        ("points", "signals"),
        ("added", "modes"),
        ("operating_points", "runs"),
        ("black_box", "oscillations", "pod_design"),
        ("immittance", "interactions", "screening", "sensitivities", "sweep"),
        ("certification", "coordinated_design", "siting", "validation"),
    ),
    "face": (("api",), ("agents", "explore"), ("cli",)),
}
"""Folder of ``orchestrator/`` → its rooms; the lowest floor and the lowest row first.

A floor imports from lower ones only, a room from lower floors and lower rows; rooms of one row do not know each other.
A study that is added stands in a room of its own, in the last row, with a module ``command``."""

FORMER = {"former_paths"}
"""Module beside the floors: where a name of an older version stands now."""

PLAIN_DATA = {"fmus.grid.names", "fmus.toolchain.port_variables", "fmus.toolchain.variables"}
"""Modules of the FMUs that the whole orchestrator may read."""


SHARED_TOOLS = {
    f"fmus.toolchain.{name}" for name in ("extras", "plugins", "removal", "slave_code", "temporary")
}
"""Modules of the FMUs that the whole orchestrator may use: they say which library is missing, find what is installed,
keep folders, and hand out compiled code."""


@dataclass(frozen=True)
class Module:
    """What the rules ask of the syntax tree of a module."""

    imported: set[str]
    """Dotted names that it imports anywhere."""

    for_types: list[set[str]]
    """The same of each block that type checkers alone read."""

    names_type_checking: bool

    classes: list[tuple[str, set[str]]]
    """Names and bases, as text, of those that no function and no class holds."""

    raised: list[tuple[int, str]]
    """Line and name of what it raises; a name of another module, such as ``errors.InputError``, is left out."""

    caught: list[tuple[int, bool]]
    """Line of each handler, and whether it says which errors."""


@asked_of_all_code
def modules():
    """Name → what is asked of every module of the packages."""
    return {source.module: read_module(source) for source in product_files(*PACKAGES)}


def read_module(source):
    return Module(
        imported=names_of_imports(source.of(ast.Import, ast.ImportFrom)),
        for_types=[
            names_of_imports(source.within(node))
            for node in (source.of(ast.If) if "TYPE_CHECKING" in source.text else ())
            if "TYPE_CHECKING" in ast.unparse(node.test)
        ],
        names_type_checking=any("TYPE_CHECKING" in node.id for node in source.of(ast.Name)),
        classes=[
            (node.name, {ast.unparse(base) for base in node.bases})
            for node in source.tree.body
            if isinstance(node, ast.ClassDef)
        ],
        raised=[
            (node.lineno, getattr(getattr(node.exc, "func", node.exc), "id", ""))
            for node in source.of(ast.Raise)
            if node.exc is not None
        ],
        caught=[(node.lineno, node.type is not None) for node in source.of(ast.ExceptHandler)],
    )


def names_of_imports(nodes):
    """Dotted names that some nodes of a syntax tree import."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@cache
def imports():
    """Module → modules of the packages that it imports."""
    graph = {}
    for name, source in modules().items():
        graph[name] = {
            t if t in modules() else t.rpartition(".")[0]
            for t in source.imported
            if within(t, *PACKAGES)
        } - {name}
        unknown = graph[name] - set(modules())
        assert not unknown, f"{name} imports {unknown}, which does not exist"
    return graph


@cache  # it is asked for each import
def inside():
    """Modules on the floors of the orchestrator."""
    return {name for name in modules() if within(name, *(f"orchestrator.{f}" for f in FLOORS))}


def within(name, *packages):
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def part(name):
    """The room that a module belongs to; a floor's own ``__init__`` is a room, and so is a floor without rooms."""
    floor = name.split(".")[1]
    return ".".join(name.split(".")[: 3 if FLOORS[floor] else 2])


def level(name):
    """Place of a module: its floor, and its room's row there; a room that no row names is a study that was added."""
    _, floor, *room = part(name).split(".")
    rows = [row for row, rooms in enumerate(FLOORS[floor]) if room and room[0] in rooms]
    return list(FLOORS).index(floor), *(rows or [len(FLOORS[floor]) - 1])


def breaches(allowed):
    """Imports, as text, for which ``allowed(importer, imported)`` does not hold."""
    edges = [
        (importer, imported) for importer, targets in imports().items() for imported in targets
    ]
    assert len(edges) > 50
    return [
        f"{importer} imports {imported}"
        for importer, imported in sorted(edges)
        if not allowed(importer, imported)
    ]


def test_the_imports_are_read():
    """The tools of this file see what is known to be there."""
    graph = imports()
    assert "fmus.toolchain.model" in graph["gfor_fmu.converter"]
    assert (
        "orchestrator.systems.coupling.observers" in graph["orchestrator.systems.coupling.master"]
    )
    assert "pandapower" in modules()["orchestrator.cases.networks.sources"].imported


def test_the_folders_of_the_orchestrator_are_the_floors():
    folders = {name.split(".")[1] for name in modules() if name.startswith("orchestrator.")}
    assert folders == {*FLOORS} | FORMER


def test_every_room_is_listed_on_its_floor_or_is_a_study():
    listed = {
        f"orchestrator.{floor}.{room}"
        for floor, rows in FLOORS.items()
        for row in rows
        for room in row
    }
    rooms = {part(name) for name in inside()} - {f"orchestrator.{floor}" for floor in FLOORS}
    assert listed <= rooms
    for room in rooms - listed:
        assert room.startswith("orchestrator.studies."), room
        assert f"{room}.command" in modules(), room


def test_the_toolchain_knows_no_model():
    assert not breaches(
        lambda a, b: within(b, "fmus.toolchain") if within(a, "fmus.toolchain") else True
    )


def test_models_know_neither_the_converter_nor_the_orchestrator():
    assert not breaches(lambda a, b: within(b, "fmus") if within(a, "fmus") else True)


def test_the_converter_is_made_from_the_toolchain_and_the_parts_of_converters_alone():
    own = ("fmus.toolchain", "fmus.converter_parts", "gfor_fmu")
    assert not breaches(lambda a, b: within(b, *own) if within(a, "gfor_fmu") else True)


def test_the_parts_of_converters_know_the_toolchain_alone():
    own = ("fmus.toolchain", "fmus.converter_parts")
    assert not breaches(lambda a, b: within(b, *own) if within(a, "fmus.converter_parts") else True)


def test_the_orchestrator_imports_downwards_only():
    def downwards(a, b):
        if not {a, b} <= inside():
            return True
        return level(b) < level(a) or part(a) == part(b)

    assert not breaches(downwards)


def test_the_orchestrator_knows_fmus_and_never_equations():
    """Cases, the face and the command line build models and archives; what is compiled here borrows the compiler.

    Everybody may know the names, units and limits that models and bindings share: `PLAIN_DATA` holds no equations.
    """
    borrowers = {
        "orchestrator.linear.models.answers_to_moves",
        "orchestrator.studies.black_box.bench",
        "orchestrator.systems.coupling.compiled_loop",
        "orchestrator.systems.coupling.wire_bank",
        "orchestrator.devices.acceptance.shifted_clock",
        "orchestrator.devices.fmi.bound_component",
        "orchestrator.devices.fmi.fmi3",
        "orchestrator.devices.sandbox.compiled_programs",
    }
    importers = {
        f"orchestrator.{name}" for name in ("cases", "face.agents", "face.api", "face.cli")
    }

    def allowed(a, b):
        if not within(a, "orchestrator") or within(b, "orchestrator"):
            return True
        if b in PLAIN_DATA:
            return True
        if b in SHARED_TOOLS:
            return True
        if a in borrowers:
            return b == "fmus.toolchain.compiler"
        if a in (
            "orchestrator.devices.fmi.vendor_files",
            "orchestrator.devices.sandbox.dll_reading_process",
        ):
            return (
                within(b, "fmus.vendor_dll", "fmus.toolchain.cache", "fmus.toolchain.archive")
                or b == "fmus"
            )
        if (
            within(a, "orchestrator.devices.acceptance.controller_dll")
            or a == "orchestrator.devices.sandbox.dll_process_worker"
        ):
            return within(b, "fmus.vendor_dll")
        if a == "orchestrator.devices.sandbox.wine_program":
            return b == "fmus.vendor_dll.memory"
        if a in ("orchestrator.devices.fmi.instance", "orchestrator.systems.ssp.archive"):
            # what was built or unpacked here, and is intact, is trusted
            return b == "fmus.toolchain.cache"
        return within(a, *importers) and not within(b, "gfor_fmu")

    assert not breaches(allowed)


@pytest.mark.parametrize("name", sorted(PLAIN_DATA))
def test_plain_data_are_read_without_symbols(name):
    code = f"import sys, {name}; sys.exit('fmus.toolchain.symbols' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


FOR_TYPES = {
    "face.api.case",
    "face.api.results",
    "cases.case",
    "cases.form.definition",
    "cases.form.given",
    "cases.form.names",
    "cases.form.values",
    "systems.coupling.connections",
    "systems.coupling.system",
    "face.cli.terminal",
    "systems.coupling.observers",
    "studies.oscillations.signs",
    "studies.oscillations.view",
    "studies.runs.tables",
    "studies.sensitivities.view",
    "output.report.plot_style",
    "output.report.fmu_variables",
    "output.results.recording_writer",
    "output.results.file_writers",
}
"""Imported by `signal compare`, `gfor verify` and `load`, which start without what computes, and by `modes`, which
starts without runs and sensitivities; `imports` counts these arrows."""


LATE = {"pandas", "scipy.interpolate", "scipy.optimize", "scipy.signal", "scipy.stats", "xarray"}
"""Libraries that `core.late` stands in for."""


def test_only_libraries_that_come_late_are_imported_for_type_checkers_alone():
    """Any other such import hides an arrow that runs back up, or a module that a start should not wait for."""
    blocks = [(name, names) for name, source in modules().items() for names in source.for_types]
    assert {name for name, _ in blocks} == {
        name for name, source in modules().items() if source.names_type_checking
    }
    hiding = [(name, names - LATE) for name, names in blocks]
    assert {name.removeprefix("orchestrator.") for name, names in hiding if names} == FOR_TYPES


POINTS = (
    "studies.sweep.point",
    "studies.screening.point",
    "studies.coordinated_design.point",
    "studies.interactions.point",
    "studies.certification.point",
    "studies.certification.codes.bench_point",
    "studies.certification.codes.change_point",
)
"""What computes a point that is kept."""


def test_every_kept_point_is_known_here():
    """Whoever computes points has the kind of their task in a module ``…point``, whose code names their files."""
    kinds = {
        name
        for name, source in modules().items()
        for _, bases in source.classes
        if bases & {"Task", "BenchTask"}
    }
    assert kinds == {f"orchestrator.{name}" for name in POINTS}


@pytest.mark.parametrize("name", POINTS)
def test_kept_points_are_worth_nothing_once_their_code_changes(name):
    """What computes a point, and all that this imports, is in the hash that names the point's file."""
    graph, pending, needed = imports(), [f"orchestrator.{name}"], set()
    while pending:
        one = pending.pop()
        if one not in needed and within(one, "orchestrator") and one != "orchestrator":
            needed.add(one)
            pending += graph[one]
    assert len(needed) > 50
    assert needed <= needed_modules(f"orchestrator.{name}")
    assert {(ROOT / n.replace(".", "/")) for n in needed} <= {
        path for file in code_files() for path in (file.with_suffix(""), file.parent)
    }


def test_there_is_no_cycle():
    graph, state = imports(), {}

    def visit(name, path):
        if state.get(name) == "done":
            return
        assert name not in path, " → ".join([*path[path.index(name) :], name])
        for target in sorted(graph[name]):
            visit(target, [*path, name])
        state[name] = "done"

    for name in graph:
        visit(name, [])
    assert set(state) == set(modules())


@pytest.mark.parametrize(
    ("library", "users"),
    [
        ("pythonfmu", {f"fmus.toolchain.{name}" for name in ("python_fmu", "slave", "wrapper")}),
        (
            "fmpy",
            {
                f"orchestrator.devices.fmi.{name}"
                for name in ("binary", "description", "loaded_component", "messages", "validation")
            },
        ),
        ("pandapower", {"orchestrator.cases.networks.sources"}),
        ("skrf", {"orchestrator.studies.black_box.fitting"}),
        ("pint", {"orchestrator.core.units"}),
        ("helics", {"orchestrator.simulation.federation.helics_calls"}),
    ],
)
def test_a_library_is_used_in_one_place(library, users):
    found = {
        name
        for name, source in modules().items()
        if any(within(n, library) for n in source.imported)
    }
    assert found == users


ON_THE_FACE = {
    "admittance": {"face.api.admittance.admittance"},
    "bind": {"face.api.binding.bind"},
    "build": {"face.api.models.build", "face.api.models.catalogue_model"},
    "check": {"face.api.acceptance.check"},
    "compare": {"face.api.comparison.compare"},
    "design": {"studies.coordinated_design.one_point.design_controller"},
    "export_ssp": {"face.api.export.write_ssp"},
    "export_comtrade": {"face.api.comtrade.export_comtrade"},
    "identify": {"face.api.identification.identify"},
    "info": {"face.api.fmu.info"},
    "linearize": {"face.cli.case_arguments.chosen"},
    "modes": {"face.cli.case_arguments.chosen"},
    "run": {"face.cli.case_arguments.chosen"},
    "screen": {"studies.screening.command.STUDY"},
}
"""Command → what it calls of the Python face; ``chosen`` gives the face's scenarios."""

COMPUTING = {
    *(
        "devices.acceptance.runner.check_fmu",
        "studies.pod_design.design.design_pod",
        "studies.signals.comparison.compare",
    ),
    *(
        "studies.signals.comparison.strongest_modes",
        "studies.modes.linear.linear_model",
        "studies.modes.modes.compute_modes",
    ),
    *(
        "studies.screening.study.run_screening",
        "studies.runs.run.run_scenario",
        "studies.sweep.sweep.plan_sweep",
        "studies.sweep.sweep.run_sweep",
    ),
}
"""Functions that the face wraps: a command that called one itself would hold a copy of the face's logic."""


@pytest.mark.parametrize("command", sorted(ON_THE_FACE))
def test_a_command_is_written_on_the_face(command):
    names = {
        name.removeprefix("orchestrator.")
        for name in modules()[f"orchestrator.face.cli.{command}"].imported
    }
    assert names >= ON_THE_FACE[command]
    assert not names & COMPUTING


def test_only_the_command_line_reads_options():
    using = {name for name, source in modules().items() if "argparse" in source.imported}
    assert using
    assert all(within(name, "orchestrator.face.cli") for name in using)


def test_equations_are_written_in_models_only():
    for name, source in modules().items():
        if within(name, "orchestrator"):
            assert not any(within(n, "fmus.toolchain.symbols") for n in source.imported), name


def test_the_slave_needs_nothing_but_python_and_pythonfmu():
    """It is copied into FMUs and runs where no package of this project is installed."""
    names = modules()["fmus.toolchain.slave"].imported
    foreign = {name for name in names if name.split(".")[0] not in sys.stdlib_module_names}
    assert foreign
    assert all(within(name, "pythonfmu") for name in foreign)
    names = modules()["fmus.toolchain.tape_kernel"].imported
    assert all(name.split(".")[0] in sys.stdlib_module_names for name in names)


# -- habits ----------------------------------------------------------------------------------------


def test_errors_are_raised_by_a_name_of_their_own():
    for name, source in modules().items():
        for line, raised in source.raised:
            assert raised not in ("Exception", "BaseException"), f"{name}, line {line}"


def test_no_error_is_caught_without_saying_which():
    handlers = [(name, *one) for name, source in modules().items() for one in source.caught]
    assert len(handlers) > 10
    for name, line, says_which in handlers:
        assert says_which, f"{name}, line {line}: bare except"


TEXT = {".py", ".toml", ".md", ".json", ".csv", ".c", ".yml", ".yaml", ".txt", ".cfg"}
OF_A_MACHINE = re.compile(
    r"(?<![\w./-])(?:/(?:home|root|Users|work|tmp|opt|mnt|var)/\w|[A-Z]:\\\w)"
)


def text_files():
    """Files of the project, without what tools leave behind."""
    tops = [*PACKAGES, "tests"]
    files = [p for p in ROOT.iterdir() if p.is_file()]
    files += [p for top in tops for p in (ROOT / top).rglob("*") if p.is_file()]
    return [p for p in files if p.suffix in TEXT and "__pycache__" not in p.parts]


def test_a_part_in_whole_percent_is_written_by_one_function():
    """Each place that wrote it by itself chose its own space and its own rounding."""
    own = re.compile(r"\{100 \* [^{}]+:\.0f\} ?%")
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    written = [path for path in files if own.search(path.read_text(encoding="utf-8"))]
    assert written == [ROOT / "orchestrator" / "core" / "units.py"]


def test_no_file_holds_a_path_of_some_machine():
    files = text_files()
    assert len(files) > 80
    texts = {path: path.read_text(encoding="utf-8") for path in files if path != Path(__file__)}
    found = [
        f"{path.relative_to(ROOT)}, line {number}: {line.strip()}"
        for path, text in texts.items()
        if OF_A_MACHINE.search(text)  # whole texts first: line by line it takes twice as long
        for number, line in enumerate(text.splitlines(), start=1)
        if OF_A_MACHINE.search(line)
    ]
    assert not found


@pytest.mark.parametrize(
    "text", ["x = '" + "/home" + "/me/file'", '"' + "C:" + '\\temp"', "see " + "/tmp" + "/a"]
)
def test_a_path_of_some_machine_is_recognised(text):
    assert OF_A_MACHINE.search(text)


@pytest.mark.parametrize(
    "text",
    ["fmus/toolchain", "https://example.org/home/x", "output/results/tmp/x", "1/s", "a/work/b"],
)
def test_what_only_looks_like_one(text):
    assert not OF_A_MACHINE.search(text)


def test_a_class_name_has_one_meaning():
    """The Python face gives the inner case and acceptance a friendlier form under the same name."""
    homes = {}
    for name, source in modules().items():
        for class_name, _ in source.classes:
            if within(name, "orchestrator") and not class_name.startswith("_"):
                homes.setdefault(class_name, []).append(name)
    twice = {name: modules for name, modules in homes.items() if len(modules) > 1}
    assert {
        name: m
        for name, m in twice.items()
        if not any(within(x, "orchestrator.face.api") for x in m)
    } == {}


def test_the_page_knows_every_room_and_where_each_question_is_answered():
    page = (ROOT / ".docs/explanation/architecture.md").read_text(encoding="utf-8")
    assert [room for room in sorted({part(m) for m in inside()}) if not _has_row(page, room)] == []
    _, _, table = page.partition("## Where is it decided?")
    rows = [row.split("|")[1:4] for row in table.partition("\n## ")[0].splitlines() if "`" in row]
    assert len(rows) >= 20
    for question, file, names in rows:
        text = (ROOT / file.strip(" `")).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            found = re.search(rf"^(def |class |function )?{name}\b", text, re.MULTILINE)
            assert found, f"{question.strip()} {file.strip()} has no {name}"


def _has_row(page, room):
    """Whether a table of the page has a folder, or a file of it."""
    _, *path = room.split(".")
    return len(path) < 2 or f"`{'/'.join(path)}" in page
