"""Records of WECC's generic converters in a PSS/E dynamics file (DYR) → parameters of `gfl_phasor`, as far as they go.

REGCA1 is a controlled current, REECA1 and REECB1 say which: P and Q by the measured voltage, or a voltage by an
integrator. Around an operating point that is what `gfl_phasor` does below about 2 Hz. What acts in dips, at limits or
on references is not taken over; `approximation` names every field that it leaves.

Sources: the order of fields as ANDES' reader and GridPACK's take it; the block diagrams as WECC's guide for generic
wind and solar models shows them."""

from collections.abc import Mapping

from fmus.wecc_renewable.dyr_records import PLANT_RECORDS

MODEL = "gfl_phasor"

CONVERTER = "REGCA1"
FIELDS: dict[str, tuple[str, ...]] = {
    record: tuple(field.name for field in PLANT_RECORDS[record].fields)
    for record in (CONVERTER, "REECA1", "REECB1")
}
"""Fields behind the identifier of the machine, in the file's order, by PSS/E's name of the record."""

PLANT = "REPCA1"  # the plant's controller, of which nothing can be taken over
# reactance [pu, S_n] by which `gfl_phasor` states its voltage control; any gives the same
# integrator
X_S = 0.5

_FLAGS = {"PFFLAG", "VFLAG", "QFLAG", "PFLAG", "PQFLAG"}
# the least values that `gfl_phasor` takes in place of smaller ones of records
_SHORTEST = 5e-3  # time constant [s]
_SHORTEST_CURRENT = 1e-3  # time constant of the current [s]
_LEAST_LIMIT = 0.1  # limit of the current [pu, S_n]
_LEAST_REACTANCE = 0.01  # [pu, S_n]


def approximation(
    records: Mapping[str, Mapping[str, float]],
) -> tuple[dict[str, float], dict[str, str]]:
    """Parameters of `gfl_phasor`, and what they leave out.

    Around an operating point with constant references, with v the voltage's magnitude: REECA1 gives δi_p = −i_p·δv/
    ((1 + s·Trv)·(1 + s·Tg)), and ours δi_p = −i_p·δv/(1 + s·τ + s²·τ·Tg) with τ = Trv + Tg. The reactive current has
    Tiq besides, or with QFLAG = 1 the integrator Kvi/s, which is 1/(s·τ·X_s).

    ``records``: of one machine, REGCA1 and REECA1 or REECB1: values by field, by the record's name. Returned are values
    by parameter, and one text for each thing that is replaced or left out, by its kind, which has no figure."""
    electrical = next((name for name in records if name != CONVERTER), None)
    if electrical is None or CONVERTER not in records:
        missing = CONVERTER if electrical else "REECA1 or REECB1"
        raise ValueError(
            f"{electrical or CONVERTER} is there, and {missing} is not; together they are the converter"
        )
    converter, control = records[CONVERTER], records[electrical]
    _check_modes(electrical, control)
    texts: dict[str, str] = {}

    def at_least(least: float, value: float, name: str) -> float:
        if value < least:
            text = f"{name} = {value:g} becomes {least:g}, the least that the model takes"
            texts[f"{name} is raised"] = text
        return max(least, value)

    slow = control["Trv"] + converter["Tg"]
    used = {"Trv", "Tg", "Imax", *(_FLAGS & {*control})}
    values = {
        "current_control.tau": at_least(_SHORTEST_CURRENT, converter["Tg"], "Tg"),
        "active_power.tau": at_least(_SHORTEST, slow, "Trv + Tg"),
        "current_limit.I_max": at_least(_LEAST_LIMIT, control["Imax"], "Imax"),
        "current_limit.priority": 1.0 if control["PQFLAG"] else 2.0,
        "transformer.X_t": _LEAST_REACTANCE,  # the network has it; the model needs a little
        "transformer.R_t": 0.0,
        "filter.B_c": _LEAST_REACTANCE,
        "reactive_power.mode": control["QFLAG"],
    }
    if control["QFLAG"]:
        used.add("Kvi")
        values["reactive_power.X_s"] = X_S
        values["reactive_power.tau"] = at_least(
            _SHORTEST, 1 / (control["Kvi"] * X_S), f"1/({X_S:g}·Kvi)"
        )
    else:
        used.add("Tiq")
        values["reactive_power.tau"] = at_least(_SHORTEST, slow + control["Tiq"], "Trv + Tg + Tiq")
        if control["PFFLAG"]:
            texts["PFFLAG"] = "PFFLAG = 1: the reactive power is held, and not the power factor"
    texts["PLL"] = (
        "a PLL of its own (pll.f_0), which REGCA1 does not have: there the current follows the angle at once"
    )
    for name, given in records.items():
        left = ", ".join(field for field in given if field not in used)
        texts[name] = f"not taken over from {name}: {left}"
    return values, texts


def _check_modes(name: str, control: Mapping[str, float]) -> None:
    for flag in sorted(_FLAGS & {*control}):
        if control[flag] not in (0.0, 1.0):
            raise ValueError(f"{name} has {flag} = {control[flag]:g}; it is 0 or 1")
    if control.get("PFLAG"):
        raise ValueError(
            f"{name} has PFLAG = 1, power by the speed of a turbine, which the model does not have"
        )
    if control["QFLAG"] and control["VFLAG"]:
        raise ValueError(
            f"{name} has QFLAG = 1 and VFLAG = 1, a voltage control within one of Q; the model has one"
        )
    if control["QFLAG"] and not control["Kvi"] > 0:
        raise ValueError(
            f"{name} has QFLAG = 1 and Kvi = {control['Kvi']:g}; a voltage control needs its integrator"
        )
