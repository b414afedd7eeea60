"""``[conventions]``: what stability programs assume about machines, as parameters of ours.

The same RAW and DYR files give other dampings elsewhere, as most programs leave the speed out of the stator's voltage,
and some take the governor's power for torque. What a program does was read in its source, or in that of a library that
its authors compared with it."""

from dataclasses import dataclass

from orchestrator.cases.draft import Draft
from orchestrator.cases.schema import ConventionsTable

EMF, TORQUE = "machine.speed_in_emf", "governor.output_is_torque"


@dataclass(frozen=True)
class Convention:
    speed_in_emf: bool  # the emf is w times the subtransient flux
    output_is_torque: bool  # the governor's output is the torque; else the power, and the torque is output/w


LIKE = {"exact": Convention(True, False), "psse": Convention(False, False), "andes": Convention(False, True)}


def assign_conventions(draft: Draft) -> None:
    """Give machines the parameters of the case's conventions, which any value given by name overrides."""
    table = draft.given.case.conventions
    if table is None:
        return
    chosen = _chosen(table)
    for name, plan in draft.system.components.items():
        own = plan.description.parameters
        if EMF not in own and not chosen.speed_in_emf and plan.description.kind == "machine":
            draft.note(
                draft.given.place("conventions"),
                f"{name} ({plan.description.model_name}) has stator transients, or no choice: its emf has the speed in "
                'it; take `models = "phasor"` and the parts of a DYR file, or speed_in_emf = true',
            )
            return
        for variable, value in ((EMF, chosen.speed_in_emf), (TORQUE, chosen.output_is_torque)):
            if variable in own:
                plan.parameters[variable] = value
                draft.places[f"{name}.{variable}"] = draft.given.place("conventions")


def _chosen(table: ConventionsTable) -> Convention:
    usual = LIKE[table.like]
    return Convention(
        usual.speed_in_emf if table.speed_in_emf is None else table.speed_in_emf,
        usual.output_is_torque if table.governor_gives is None else table.governor_gives == "torque",
    )
