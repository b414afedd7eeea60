"""``gfor build``: FMUs of the catalogue's models."""

import argparse
from pathlib import Path

from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.compiler import TARGETS
from fmus.toolchain.extras import require
from fmus.toolchain.model import Model
from orchestrator.cli import linear_model
from orchestrator.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor build``."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="models (default: all that need no further data)")
    parser.add_argument("--dest", type=Path, default=Path(), metavar="DIR", help="folder (default: here)")
    parser.add_argument("--native", action="store_true", help="compiled FMUs with no Python in them")
    parser.add_argument("--fmi", choices=("2.0", "3.0"), default="2.0", help="version of FMI (3.0: native only)")
    parser.add_argument(
        "--platform",
        action="append",
        choices=sorted(TARGETS),
        help="compile for this platform (repeatable; default: this machine's, for native FMUs all)",
    )
    linear_model.add_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Build every model and print the files' paths."""
    if options.fmi != "2.0" and not options.native:
        raise InputError("--fmi 3.0 is for native FMUs: pythonfmu's wrapper speaks FMI 2.0; add --native")
    require("building FMUs", "casadi", "pythonfmu", "ziglang")
    from fmus.toolchain.exporter import export  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - as above
    from fmus.toolchain.python_fmu import PythonFmu  # noqa: PLC0415 - as above

    names = options.names or [name for name in model_names() if not needs_arguments(name)]
    models = [_model(name) for name in names]
    extra = linear_model.extra_members(options, [model.name for model in models])
    platforms = tuple(options.platform) if options.platform else None
    for model in models:
        recipe = NativeFmu(model, options.fmi) if options.native else PythonFmu(model)
        print(export(recipe, options.dest, platforms, extra))
    return 0


def _model(name: str) -> Model:
    if name not in model_names():
        raise InputError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
    if needs_arguments(name):
        raise InputError(
            f"model {name!r} is built from the [network] table of a case file, by `gfor run` or `gfor modes`"
        )
    return build_model(name)
