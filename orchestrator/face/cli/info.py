"""``gfor fmu info``: what an FMU declares."""

import argparse

from rich.markup import escape

from fmus.vendor_dll.interface import CONTROLLER
from orchestrator.devices.fmi.description import FmuDescription, hindrance_here
from orchestrator.devices.fmi.linear_model import EmbeddedModel
from orchestrator.face.api.dll import KEPT_IN
from orchestrator.face.api.fmu import info
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.output.report.fmu_variables import fmu_variables


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "info")


def run(options: argparse.Namespace) -> int:
    found = info(options.file)
    if options.json:
        print_json(found.as_json())
        return 0
    description = found.description
    console = make_console()
    console.print(f"[bold]{escape(description.model_name)}[/bold]: {escape(description.title)}")
    console.print(
        f"FMI {description.fmi_version} co-simulation, guid {escape(description.guid)}, "
        f"made by {escape(description.generation_tool or 'an unnamed tool')}",
        highlight=False,
    )
    settable = "settable by a master" if description.states_are_settable else "not settable"
    console.print(
        f"platforms: {', '.join(description.platforms)}; {_states(description)} ({settable}); "
        f"state can be saved and restored: {'yes' if description.can_save_state else 'no'}",
        highlight=False,
    )
    hindrance = hindrance_here(description)
    if hindrance:
        console.print(
            f"[bold]It cannot run here[/bold]: {escape('; '.join(hindrance))}", highlight=False
        )
    if description.kept_in:
        why = f" ({description.kept_why})" if description.kept_why else ""
        kept = KEPT_IN.get(description.kept_in, description.kept_in)
        console.print(escape(f"a vendor's DLL: {kept}{why}"), highlight=False)
    if found.linear_model is not None:
        console.print(escape(_in_words(found.linear_model)), highlight=False)
    for table in fmu_variables(description):
        console.print()
        if isinstance(table, str):
            print(table)
        else:
            console.print(table)
    return 0


def _states(description: FmuDescription) -> str:
    """How many there are; those of a vendor's DLL are no continuous ones, and by what they are."""
    if not description.kept_in:
        return f"continuous states: {len(description.states)}"
    of_circuit = [
        name
        for name in description.states
        if description.frequency and not name.startswith(CONTROLLER)
    ]
    own, circuit = [name.removeprefix(CONTROLLER) for name in description.states], len(of_circuit)
    held = sum(name.startswith("held.") for name in own)
    memory = sum(name.startswith("memory[") for name in own)
    parts = (
        (len(own) - circuit - held - memory, "in the arrays that it declares"),
        (memory, "in its own memory"),
        (held, "outputs held until its next sample"),
        (circuit, "of the circuit around it"),
    )
    told = ", ".join(f"{count} {where}" for count, where in parts if count)
    return f"states of a sampled controller: {told or 'none'}"


def _in_words(model: EmbeddedModel) -> str:
    size = f"{len(model.states)} states, {len(model.inputs)} inputs, {len(model.outputs)} outputs"
    origin = ", ".join(
        f"{key} {model.origin[key]}"
        for key in ("case", "scenario", "component")
        if key in model.origin
    )
    return f"linear model inside: {size}" + (
        f", at the operating point of {origin}" if origin else ""
    )
