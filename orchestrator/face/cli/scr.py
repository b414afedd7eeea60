"""``gfor scr``: short-circuit power of every bus, and the short-circuit ratio of the converters there."""

import argparse
import json
from typing import Any

from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.short_circuit import CONVENTION, BusStrength, weakest_first
from orchestrator.face.cli.arguments import add_json_argument, add_kept_argument, add_options
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.terminal import keep_json, make_console, print_json
from orchestrator.output.report.strength_table import strength_table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    add_options(parser, "scr")
    add_json_argument(parser)
    add_kept_argument(parser, "scr")
    parser.set_defaults(scans=True)


def run(options: argparse.Namespace) -> int:
    convention = CONVENTION.format(options.converter_current)
    found = {
        s: weakest_first(s.strengths(options.converter_current, options.rating))
        for s in chosen(options)
    }
    told = [
        {"name": s.name, "buses": [_with_title(s.prepared, bus) for bus in buses]}
        for s, buses in found.items()
    ]
    about = next(iter(found)).prepared.about
    kept = {key: about[key] for key in ("case", "models", "basis", "questions")}
    names = next(iter(found)).prepared.names
    content = kept | names.as_json() | {"convention": convention, "scenarios": told}
    keep_json(content, options.out, "scr")
    if options.json:
        print_json(content)
        return 0
    alike: dict[str, list[str]] = {}
    for scenario, buses in found.items():
        with_titles = [_with_title(scenario.prepared, bus) for bus in buses]
        alike.setdefault(json.dumps(with_titles), []).append(scenario.title)
    console = make_console(names=names)
    for rows, titles in alike.items():
        console.print(strength_table(", ".join(titles), json.loads(rows)), "")
    console.print(escape(f"Convention: {convention}."), soft_wrap=True, highlight=False)
    return 0


def _with_title(prepared: PreparedScenario, bus: BusStrength) -> dict[str, Any]:
    """The bus as JSON, with its name in the network's file, and its area where that has several."""
    area = prepared.regions.area_of(bus.bus)
    title = {"title": prepared.titles.get(bus.bus, "")}
    return bus.as_json() | title | ({"area": area} if area else {})
