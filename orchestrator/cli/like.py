"""``gfor run --like``: as another master would give it."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import option
from orchestrator.errors import InputError
from orchestrator.interop.masters import MASTERS, master_rules
from orchestrator.interop.rules import MasterRules
from orchestrator.results.staging import new_run_id, staged
from orchestrator.results.storage import save_dataset
from orchestrator.study.like import run_like


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, "--like", "MASTER", f"only trajectories, as another master would give them: {', '.join(MASTERS)}")
    option(parser, "--order", "A,B,…", "with --like: in which order components step, where they take turns")


def rules_of(options: argparse.Namespace) -> MasterRules | None:
    if options.order and not options.like:
        raise InputError("--order goes with --like MASTER; our own order stands in the case, under [solver]")
    if options.like and (options.threads or options.workers):
        raise InputError("--like steps as another master does, on one thread; leave out --threads, --workers or --like")
    if options.like and options.tolerance is not None:
        raise InputError("--like steps as another master does, in fixed steps; leave out --tolerance or --like")
    return master_rules(options.like) if options.like else None


def run(scenarios: Sequence[PreparedScenario], rules: MasterRules, folder: Path, turns: str | None) -> int:
    """Run scenarios as another master would; their trajectories are all that is written.

    ``turns`` are components with commas between them, in the order in which they step; the master's own where None."""
    order = turns.split(",") if turns else None
    run_id = new_run_id()
    for prepared in scenarios:
        dataset = run_like(prepared, rules, order)
        path = folder / prepared.name / "trajectory"
        with staged(folder / prepared.name, run_id) as staging:
            save_dataset(dataset, staging / "trajectory")
        print(f"{prepared.name} like {rules.title}: {dataset.sizes['time']} rows in {path}.nc and .csv")
    return 0
