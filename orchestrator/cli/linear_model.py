"""``gfor fmu build --with-linear-model``: which component of which case the model inside the FMU is of."""

import argparse

from orchestrator.cases.case import load_case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import option
from orchestrator.errors import InputError
from orchestrator.fmi.linear_model import linear_model_members
from orchestrator.study.component_model import component_model

OPTION = "--with-linear-model"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(OPTION, dest="linear_case", metavar="CASE", help="pack the model's linear model at the steady "
                        "state of this case into the FMU")  # fmt: skip
    option(parser, "--scenario", "NAME", "scenario of that case (default: its only one)")
    option(parser, "--component", "NAME", "component of that case (default: the only one of this model)")


def extra_members(options: argparse.Namespace, models: list[str]) -> dict[str, bytes]:
    """Members for the FMU's ``extra/`` folder; nothing without the option."""
    if options.linear_case is None:
        if options.scenario or options.component:
            raise InputError(f"--scenario and --component say more of {OPTION}; add it")
        return {}
    if len(models) != 1:
        raise InputError(f"{OPTION} needs one model to build, not {len(models)}; name it before the options")
    case = load_case(options.linear_case)
    scenario = _one("--scenario", "scenario", options.scenario, list(case.scenarios), f"the case {case.name!r}")
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
    return _one("--component", f"component of the model {model!r}", wanted, known, f"scenario {prepared.name!r}")


def _one(option: str, what: str, wanted: str | None, known: list[str], where: str) -> str:
    if wanted is None and len(known) == 1:
        return known[0]
    if wanted not in known:
        asked = f"there is no {what} {wanted!r}" if wanted else f"there are several {what}s"
        raise InputError(f"{OPTION}: {asked} in {where}; choose with {option} from: {', '.join(known)}")
    return wanted
