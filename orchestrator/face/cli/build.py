"""``gfor fmu build``: FMUs of the catalogue's models."""

import argparse
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fmus.toolchain.catalogue import model_names, needs_arguments
from fmus.toolchain.component import PLATFORM
from fmus.toolchain.model import FmiVersion
from fmus.toolchain.native_fmu import PLATFORMS
from orchestrator.cases.case import load_case
from orchestrator.cases.form.build_choices import PARTS, RECORDS, chosen_parts
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.linear_model import linear_model_members
from orchestrator.face.api.dll import build_from_dll
from orchestrator.face.api.models import build, catalogue_model
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_errors, said_stages
from orchestrator.studies.modes.linear_model_files import component_model

Port = Literal["dq", "abc", "phasor"]

# of the names of models with a port
ENDINGS: dict[Port, str] = {"dq": "", "abc": "_abc", "phasor": "_phasor"}


@dataclass(frozen=True)
class Tool:
    """The kind of file to build for a host.

    ``why``: the reason for the kind, the version and the port.
    ``source``: where that is to be read; "here" where our own tests run such FMUs in it."""

    native: bool
    fmi: FmiVersion
    port: Port
    platforms: tuple[str, ...]
    why: str
    source: str

    @property
    def kind(self) -> str:
        return "native" if self.native else "Python-backed"


HOSTS = {
    name: Tool(**table | {"platforms": tuple(table["platforms"])})
    for name, table in tomllib.loads(
        Path(__file__).with_name("build_hosts.toml").read_text(encoding="utf-8")
    ).items()
}


def with_port(name: str, port: Port, known: tuple[str, ...]) -> str:
    """The model with a port; the one that was asked for where it has another port by its name, or there is none."""
    found = name + ENDINGS[port]
    return (
        found
        if found in known and not name.endswith(tuple(filter(None, ENDINGS.values())))
        else name
    )


_SUCH_AS = {
    "machine": "genrou",
    "exciter": "sexs",
    "governor": "tgov1",
    "stabilizer": "pss1a",
    "oel": "maxex2",
    "uel": "mnlex2",
}

_NEEDS = (
    "A Python-backed FMU needs a host that is a program in Python (3.8 or newer), such as FMPy; for others add "
    "--native, or let --for HOST choose"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "build", hosts=HOSTS, listed=", ".join(HOSTS), platforms=sorted(PLATFORMS))
    for part in PARTS:
        parser.add_argument(
            f"--{part}",
            metavar="PART",
            help=f"{part} of synchronous_generator, such as {_SUCH_AS[part]}",
        )
    parser.add_argument(
        f"--{RECORDS}",
        metavar="NAMES",
        help="PSS/E's records that wecc_plant_phasor is made of, such as 'REGCB1 REECC1 REPCA1', or a compensator's, "
        "such as 'CSVGN5 elsewhere'",
    )


def run(options: argparse.Namespace) -> int:
    if options.from_dll is not None:
        return _from_dll(options)
    if options.host is not None:
        _take_from_table(options)
    options.fmi = options.fmi or "2.0"
    if options.fmi != "2.0" and not options.native:
        raise InputError(
            "--fmi 3.0 is for native FMUs: pythonfmu's wrapper speaks FMI 2.0; add --native"
        )
    if options.sources and not options.native:
        raise InputError("--sources is for native FMUs, which are compiled from C; add --native")
    if PLATFORM in (options.platform or ()) and options.fmi != "3.0":
        raise InputError(
            f"--platform {PLATFORM} is for native FMUs of FMI 3.0: add --native --fmi 3.0"
        )
    parts = chosen_parts(options)
    if parts and not options.names:
        raise InputError(
            f"--{next(iter(parts))} is for one model: name it, such as synchronous_generator"
        )
    models = [catalogue_model(name, parts) for name in _find_names(options)]
    extra = extra_members(options, [model.name for model in models])
    kind = "native" if options.native else "Python-backed"
    with said_stages() as report:
        for number, model in enumerate(models, start=1):
            report(f"{model.name}: building, {kind} ({number} of {len(models)})")
            built = build(
                model,
                options.dest,
                native=options.native,
                fmi=options.fmi,
                platforms=options.platform,
                extra=extra,
                reference=options.reference,
                sources=options.sources,
            )
            print(built)
    if not options.native and options.host is None:
        make_errors().print(_NEEDS, soft_wrap=True)
    return 0


def _find_names(options: argparse.Namespace) -> list[str]:
    """Names of the models to build: those that were typed, or each with ``--all``."""
    known = model_names()
    if options.all and options.names:
        raise InputError(f"--all builds each model: leave it out, or the name {options.names[0]}")
    if options.all:
        return [name for name in known if not needs_arguments(name)]
    if not options.names:
        raise InputError(
            f"no model is named, and nothing is built; name one of {', '.join(known)}; or give --all for each"
        )
    strange = [name for name in options.names if name not in known]
    if strange and len(options.names) > 1:
        first = next((name for name in options.names if name in known), "gfor")
        raise InputError(
            f"there is no model {strange[0]!r}; there are: {', '.join(known)}. If it is a folder, write gfor fmu build "
            f"{first} --dest {strange[0]}"
        )
    return list(options.names)


def _take_from_table(options: argparse.Namespace) -> None:
    given = {"--native": options.native, "--fmi": options.fmi, "--platform": options.platform}
    said = [name for name, value in given.items() if value]
    if said:
        raise InputError(
            f"--for {options.host} chooses that by itself: leave out {', '.join(said)}, or --for"
        )
    host = HOSTS[options.host]
    options.native, options.fmi, options.platform = host.native, host.fmi, list(host.platforms)
    names = [with_port(name, host.port, model_names()) for name in _find_names(options)]
    options.names, options.all = list(dict.fromkeys(names)), False
    make_errors().print(
        f"for {options.host}: {host.kind}, FMI {host.fmi}, {', '.join(host.platforms)}; port: {host.port}. Why: "
        f"{host.why} ({host.source})",
        soft_wrap=True,
        markup=False,
    )


def _from_dll(options: argparse.Namespace) -> int:
    if (
        options.names
        or options.all
        or options.native
        or options.platform
        or options.reference
        or options.fmi == "3.0"
        or options.host
    ):
        raise InputError(
            "--from-dll takes the DLL's own name, its platform and FMI 2.0: leave out names, --all, --native, "
            "--platform, --reference, --fmi and --for"
        )
    pairs = [entry.partition("=") for entry in options.text]
    wrong = [name for name, sign, _ in pairs if not (name and sign)]
    if wrong:
        raise InputError(f"--text {wrong[0]}: give NAME=VALUE")
    built = build_from_dll(
        options.from_dll, options.dest, texts={name: value for name, _, value in pairs}
    )
    for line in built.told:
        print(line)
    print(built.path)
    return 0


OPTION = "--with-linear-model"


def extra_members(options: argparse.Namespace, models: list[str]) -> dict[str, bytes]:
    if options.linear_case is None:
        if options.scenario or options.component:
            raise InputError(f"--scenario and --component say more of {OPTION}; add it")
        return {}
    if len(models) != 1:
        raise InputError(
            f"{OPTION} needs one model to build, not {len(models)}; name it before the options"
        )
    case = load_case(options.linear_case)
    scenario = _chosen(
        "--scenario", "scenario", options.scenario, list(case.scenarios), f"the case {case.name!r}"
    )
    (prepared,) = case.prepare([scenario], {"*.native": True} if options.native else {})
    component = _component(options.component, models[0], prepared)
    return linear_model_members(component_model(prepared, component))


def _component(wanted: str | None, model: str, prepared: PreparedScenario) -> str:
    plans = prepared.system.components
    known = [name for name, plan in plans.items() if plan.description.model_name == model]
    if not known:
        made = sorted({plan.description.model_name for plan in plans.values()})
        raise InputError(
            f"{OPTION}: scenario {prepared.name!r} has no component of the model {model!r}; it has some of: "
            f"{', '.join(made)}"
        )
    return _chosen(
        "--component",
        f"component of the model {model!r}",
        wanted,
        known,
        f"scenario {prepared.name!r}",
    )


def _chosen(option: str, what: str, wanted: str | None, known: list[str], where: str) -> str:
    if wanted is None and len(known) == 1:
        return known[0]
    if wanted not in known:
        asked = f"there is no {what} {wanted!r}" if wanted else f"there are several {what}s"
        raise InputError(
            f"{OPTION}: {asked} in {where}; choose with {option} from: {', '.join(known)}"
        )
    return wanted
