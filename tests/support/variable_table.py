"""Tables of variables in the leaflets of the FMU folders; `python -m tests.support.variable_table` renews them."""

import re
from pathlib import Path

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model import Model
from fmus.toolchain.variables import CalculatedParameter, Input, Output, Parameter, State, Variable

ROOT = Path(__file__).parents[2]
LEAFLETS = {
    "gfor": ROOT / "gfor_fmu" / "README.md",
    "synchronous_generator_ac4a": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "synchronous_generator_st1": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "synchronous_generator_st4b": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "synchronous_generator_ac4a_phasor": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "synchronous_generator_st1_phasor": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "synchronous_generator_st4b_phasor": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "two_area_phasor_grid": ROOT / "fmus" / "grid" / "README.md",
    "synchronous_generator_st4b_pss2a": ROOT / "fmus" / "synchronous_generator" / "README.md",
    "two_area_grid": ROOT / "fmus" / "grid" / "README.md",
    "gfl": ROOT / "fmus" / "grid_following" / "README.md",
    "gfl_phasor": ROOT / "fmus" / "grid_following" / "README.md",
    "gfl_l2ep": ROOT / "fmus" / "gfl_l2ep" / "README.md",
    "gfl_l2ep_phasor": ROOT / "fmus" / "gfl_l2ep" / "README.md",
    "external_grid": ROOT / "fmus" / "external_grid" / "README.md",
    "external_grid_phasor": ROOT / "fmus" / "external_grid" / "README.md",
    "static_generation": ROOT / "fmus" / "static_generation" / "README.md",
    "static_generation_phasor": ROOT / "fmus" / "static_generation" / "README.md",
    "regfm_a1_phasor": ROOT / "fmus" / "regfm_a1" / "README.md",
    "regfm_b1_phasor": ROOT / "fmus" / "regfm_b1" / "README.md",
    "regfm_c1_phasor": ROOT / "fmus" / "regfm_c1" / "README.md",
    "csvgn1_phasor": ROOT / "fmus" / "static_var" / "README.md",
    "svsmo1_phasor": ROOT / "fmus" / "static_var" / "README.md",
    "csvgn3_phasor": ROOT / "fmus" / "static_var" / "README.md",
    "csvgn5_phasor": ROOT / "fmus" / "static_var" / "README.md",
    "cstatt_phasor": ROOT / "fmus" / "static_var" / "README.md",
    "lcc_rectifier_phasor": ROOT / "fmus" / "dc_line" / "README.md",
    "lcc_inverter_phasor": ROOT / "fmus" / "dc_line" / "README.md",
    "dera1_phasor": ROOT / "fmus" / "distributed_generation" / "README.md",
    "pvd1_phasor": ROOT / "fmus" / "distributed_generation" / "README.md",
    "induction_generator_phasor": ROOT / "fmus" / "induction_machine" / "README.md",
    "induction_motor_phasor": ROOT / "fmus" / "induction_machine" / "README.md",
    "regca1_phasor": ROOT / "fmus" / "wecc_renewable" / "README.md",
    "regca1_repca1_phasor": ROOT / "fmus" / "wecc_renewable" / "README.md",
    "regca1_repca1_remote_phasor": ROOT / "fmus" / "wecc_renewable" / "README.md",
    "plant_controller_phasor": ROOT / "fmus" / "wecc_renewable" / "README.md",
    "infinite_bus": ROOT / "fmus" / "infinite_bus" / "README.md",
    "test_bench": ROOT / "fmus" / "test_bench" / "README.md",
    "probe_a": ROOT / "fmus" / "probe" / "README.md",
    "probe_b": ROOT / "fmus" / "probe" / "README.md",
}
FAMILY = ("gfor", "gfor_abc", "gfor_phasor")
"""Models with one table for all of them."""

KINDS = {
    Input: "input",
    Output: "output",
    Parameter: "parameter",
    CalculatedParameter: "calculated",
    State: "state",
}


def variable_table(model: Model) -> str:
    """All variables of a model as a Markdown table."""
    rows = [
        "| Name | Kind | Unit | Start | Range | Description | Source |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        rows += [_row(v) for v in model.variables if type(v) is kind]
    return "\n".join(rows)


def _row(v: Variable) -> str:
    start, bounds, source, kind = "", "", "", KINDS[type(v)]
    if isinstance(v, Parameter):
        kind = "tunable" if v.tunable else "parameter"
        source = v.source
        start = str(bool(v.start)).lower() if v.type == "Boolean" else f"{v.start:g}"
        if v.minimum is not None or v.maximum is not None:
            bounds = " … ".join(
                "" if b is None else f"{b:g}" for b in (v.minimum, v.maximum)
            ).strip()
    elif isinstance(v, Input):
        start = f"{v.start:g}"
    return f"| `{v.name}` | {kind} | {v.unit} | {start} | {bounds} | {v.text.replace('|', 'abs ')} | {source} |"


def family_table() -> str:
    """Inputs, outputs and parameters of the family, each once: both PODs in one row, ``*`` where it is tunable; states
    by name."""
    found: dict[str, dict[str, list[Variable]]] = {}
    for name in FAMILY:
        for v in build_model(name).variables:
            key = v.name.replace("pod_p.", "pod_q.").replace("delta_q_pod", "delta_p_pod")
            found.setdefault(key, {}).setdefault(name, []).append(v)
    rows = ["|Name|Unit|Start|Range|What|", "|---|---|---|---|---|"]
    states = []
    for key, by_model in found.items():
        first = next(iter(by_model.values()))
        if isinstance(first[0], State | CalculatedParameter):
            states.append(f"`{key}`")
            continue
        starts = dict.fromkeys(
            _row(v).split(" | ")[3] for all_of in by_model.values() for v in all_of
        )
        only = (
            ""
            if len(by_model) == len(FAMILY)
            else f"{', '.join(m.removeprefix('gfor_') for m in by_model)}: "
        )
        names = ",".join(f"`{v.name}`" for v in first)
        mark = "*" if isinstance(first[0], Parameter) and first[0].tunable else ""
        text = re.sub(
            r" \[.*\]| \(.*\)| of POD-[PQ]|; .*", "", first[0].text.replace("|", "abs ")
        ).strip()
        bounds = _row(first[0]).split(" | ")[4].replace(" ", "")
        kind = KINDS[type(first[0])]
        said = f"{only}{kind + ': ' if kind != 'parameter' else ''}{text}"
        rows.append(
            f"|{names}{mark}|{first[0].unit}|{','.join(starts).replace(' ', '')}|{bounds}|{said}|"
        )
    table = "\n".join(rows)
    return f"{table}\n\nStates and calculated values: {', '.join(states)}."


def section(name: str) -> str:
    """The generated part of a leaflet, markers included."""
    table = family_table() if name == "gfor" else variable_table(build_model(name))
    return f"<!-- variables:{name} -->\n{table}\n<!-- /variables:{name} -->"


def renew(text: str, name: str) -> str:
    """A leaflet's text with one table made anew."""
    pattern = re.compile(rf"<!-- variables:{name} -->.*?<!-- /variables:{name} -->", re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"the leaflet has no section for {name}")
    return pattern.sub(lambda _: section(name), text)


def main() -> None:
    for name, path in LEAFLETS.items():
        path.write_text(renew(path.read_text(encoding="utf-8"), name), encoding="utf-8")


if __name__ == "__main__":
    main()
