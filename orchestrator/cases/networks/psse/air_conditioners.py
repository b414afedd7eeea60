"""Air conditioners of one phase while they run: ACMTBLU1, and motor D of a composite load.

    V ≥ V_brk   P = P_0 + K_p1·(V − V_brk)^N_p1,   Q = Q_0 + K_q1·(V − V_brk)^N_q1        [pu of the rating]
    V < V_brk   P = P_0 + K_p2·(V_brk − V)^N_p2,   Q = Q_0 + K_q2·(V_brk − V)^N_q2
    P times 1 + CmpKpf·Δf,   Q times 1 + CmpKqf·Δf,   V_brk = VBRK·(1 + LFADJ·(COMPLF − 1))

The rating is P by COMPLF, and P_0 and Q_0 are those with which the load draws its P at the power factor COMPPF. What
its reactive power differs by is a susceptance beside it. Near the file's voltage that is the mixture of
impedance, current and power with the same power, slope and curvature. Left out: stalling and restarting, and the trips
of contactors, undervoltage relays and thermal protection.

Sources: WECC, "Composite Load Model for Dynamic Simulations" (2012); order of the fields and equations as GridPACK at
bea5ce1a has them (`acmtblu1.hpp`, `acmotor.cpp`), the order as InterPSS reads it too."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, isnan, tan

from fmus.grid.element_data import LAWS, Zip
from fmus.induction_machine.dyr_records import SUBSYSTEMS
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, number_in
from orchestrator.core.errors import InputError, number_of

AIR_CONDITIONERS = tuple(f"ACMT{subsystem}U1" for subsystem in SUBSYSTEMS)
"""The records, the narrower first."""

_NAMES = """
TSTALL TRESTART TV TF COMPLF COMPPF VSTALL RSTALL XSTALL LFADJ KP1 NP1 KQ1 NQ1 KP2 NP2 KQ2 NQ2 VBRK FRST VRST CMPKPF
CMPKQF VC1OFF VC2OFF VC1ON VC2ON TTH TH1T TH2T FUVR UVTR1 TTR1 UVTR2 TTR2
"""

FIELDS = tuple(_NAMES.split())
"""Names of the numbers of a motor, in their order."""

_COUNTS = 7  # values before them where the record is a user's model
_LEAST_DISTANCE = 1e-6  # of the voltage from VBRK [pu], at which a power of it has a slope


@dataclass(frozen=True)
class RunningLaw:
    """How P and Q of running motors follow voltage and frequency, relative to those at the start."""

    active: Zip
    reactive: Zip
    k_pf: float
    k_qf: float


def numbers_of_air_conditioner(record: DynamicRecord) -> list[float]:
    """Return the numbers of a record ACMTBLU1; an `InputError` where it has not these."""
    count = len(record.values)
    if count not in (len(FIELDS), len(FIELDS) + _COUNTS):
        raise InputError.at(
            record.place,
            f"{record.name} has {number_of(count, 'value')}, and needs {len(FIELDS)} ({FIELDS[0]} to {FIELDS[-1]}), "
            f"or {_COUNTS} before these where it is written as USRLOD",
        )
    texts = record.values[-len(FIELDS) :]
    numbers = [number_in(text) for text in texts]
    for name, text, number in zip(FIELDS, texts, numbers, strict=True):
        if isnan(number):
            raise InputError.at(
                record.place, f"{record.name} has {name} = {text!r}; it must be a number"
            )
    return numbers


def running_law(
    record: DynamicRecord, numbers: Sequence[float], drawn: complex, v_0: float
) -> RunningLaw:
    """Return the law of motors that draw ``drawn`` [MW, Mvar] at ``v_0`` [pu], with the susceptance beside them."""
    p = dict(zip(FIELDS, numbers, strict=True))
    loading = p["COMPLF"] or 1.0  # 0 stands for the whole rating, as GridPACK has it
    if loading < 0 or not 0 < p["COMPPF"] <= 1:
        raise InputError.at(
            record.place,
            f"{record.name} has the loading {loading:g} and the power factor {p['COMPPF']:g} of a motor of one phase; "
            "the loading must be 0 or more, and the power factor exceed 0 and be at most 1",
        )
    v_break = p["VBRK"] * (1 + p["LFADJ"] * (loading - 1))
    branch = 1 if v_0 >= v_break else 2
    of_p = _moves(p[f"KP{branch}"] / loading, p[f"NP{branch}"], v_0, v_break)
    of_q = _moves(p[f"KQ{branch}"] / loading, p[f"NQ{branch}"], v_0, v_break)
    active = _with(*of_p)
    if not drawn.imag:
        return RunningLaw(active, LAWS["power"], p["CMPKPF"], 0.0)
    own = drawn.real * tan(acos(p["COMPPF"])) / drawn.imag
    by_p, rest = drawn.real / drawn.imag, 1 - own
    slope, curvature = (by_p * move + 2 * rest for move in of_q)
    return RunningLaw(active, _with(slope, curvature), p["CMPKPF"], p["CMPKQF"] * own)


def _moves(gain: float, exponent: float, v_0: float, v_break: float) -> tuple[float, float]:
    """Return slope and curvature of gain·|V − V_brk|^exponent by V/V_0 at V_0."""
    away = 1.0 if v_0 >= v_break else -1.0
    distance = max(abs(v_0 - v_break), _LEAST_DISTANCE)
    slope = away * gain * exponent * distance ** (exponent - 1) * v_0
    curvature = gain * exponent * (exponent - 1) * distance ** (exponent - 2) * v_0**2
    return slope, curvature


def _with(slope: float, curvature: float) -> Zip:
    """Return the mixture that is 1 at v = 1 with this slope and curvature."""
    z = curvature / 2
    i = slope - curvature
    return Zip(z, i, 1 - z - i)
