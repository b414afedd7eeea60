"""Machines, exciters, governors and stabilisers by name: what `synchronous_generator` can be made of."""

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fmus.synchronous_generator.excitation.alternator import ac8b, esac6a, exac2, exbas
from fmus.synchronous_generator.excitation.bridge import st5b, st6b, st7b, st8c
from fmus.synchronous_generator.excitation.common import Exciter
from fmus.synchronous_generator.excitation.compound import esst2a, esst3a, exst2, exst3, ieeet3
from fmus.synchronous_generator.excitation.integral import ac7b, dc4b, expic1
from fmus.synchronous_generator.excitation.limited_alternator import esac2a, esac3a, exac3
from fmus.synchronous_generator.excitation.nve import exni
from fmus.synchronous_generator.excitation.rexsys import rexsys
from fmus.synchronous_generator.excitation.rheostat import ieeet4, ieeet5
from fmus.synchronous_generator.excitation.rotating import (
    ac1a,
    ac4a,
    ac5a,
    dc1a,
    dc2a,
    ieeet1,
    ieeet2,
    ieeex2,
)
from fmus.synchronous_generator.excitation.static import scrx, sexs, st1a, st4b
from fmus.synchronous_generator.excitation.two_limits import bbsex1
from fmus.synchronous_generator.excitation.without_regulator import external, manual
from fmus.synchronous_generator.limiters.common import Limiter, Limiters
from fmus.synchronous_generator.limiters.oel2c import oel2c
from fmus.synchronous_generator.limiters.oel3c import oel3c
from fmus.synchronous_generator.limiters.oel4c import oel4c
from fmus.synchronous_generator.limiters.overexcitation import maxex1, maxex2
from fmus.synchronous_generator.limiters.uel2c import uel2, uel2c
from fmus.synchronous_generator.limiters.underexcitation import mnlex2, uel1
from fmus.synchronous_generator.machine import FluxDeclaration, Machine
from fmus.synchronous_generator.machines.classical import classical
from fmus.synchronous_generator.machines.standard import (
    genroe,
    genrou,
    genrou_rated_speed,
    gensae,
    gensal,
    two_axis,
)
from fmus.synchronous_generator.machines.type_j import gentpj
from fmus.synchronous_generator.stabilization.bands import pss3b, pss4b
from fmus.synchronous_generator.stabilization.damping import pod, pod_input, with_pod
from fmus.synchronous_generator.stabilization.legacy import iee2st, ieeest, st2cut, stab2a
from fmus.synchronous_generator.stabilization.standard import pss1a, pss2a, pss2b, pss2c
from fmus.synchronous_generator.turbines.diesel import degov, degov1
from fmus.synchronous_generator.turbines.gas import gast2a
from fmus.synchronous_generator.turbines.ggov1 import ggov1
from fmus.synchronous_generator.turbines.governors import (
    constant_power,
    constant_torque,
    gast,
    hygov,
    read_either_way,
    tgov1,
)
from fmus.synchronous_generator.turbines.load_control import with_load_control
from fmus.synchronous_generator.turbines.steam import ieeeg1, ieesgo, tgov3, wsieg1
from fmus.synchronous_generator.turbines.water import hygov2, ieeeg2, ieeeg3
from fmus.synchronous_generator.turbines.water_pid import pidgov, wpidhy, wshygp
from fmus.synchronous_generator.turbines.woodward import wehgov
from fmus.synchronous_generator.variants import Governor, Stabilizer, of_speed
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr

MachinePart = Callable[[ModelBuilder, DevicePort, Expr, FluxDeclaration], Machine]
"""Declares a machine: builder, port with the operating point, rating [MVA], and how the stator's fluxes are declared:
as states, or as signals that a model without stator transients closes."""

NONE = "none"  # the stabiliser or limiter of a generator that has none

MACHINES: dict[str, MachinePart] = {
    "classical": classical,
    "two_axis": two_axis,
    "gensal": gensal,
    "gensae": gensae,
    "genrou": genrou,
    "genroe": genroe,
    "genrou_rated_speed": genrou_rated_speed,
    "gentpj": gentpj,
}
EXCITERS: dict[str, Exciter] = {
    "manual": manual,
    "sexs": sexs,
    "scrx": scrx,
    "exni": exni,
    "ieeet1": ieeet1,
    "ieeet2": ieeet2,
    "ieeex2": ieeex2,
    "dc1a": dc1a,
    "dc2a": dc2a,
    "ac1a": ac1a,
    "exac2": exac2,
    "esac2a": esac2a,
    "esac3a": esac3a,
    "exac3": exac3,
    "esac6a": esac6a,
    "ac8b": ac8b,
    "ac7b": ac7b,
    "dc4b": dc4b,
    "expic1": expic1,
    "ac4a": ac4a,
    "ac5a": ac5a,
    "exbas": exbas,
    "rexsys": rexsys,
    "ieeet3": ieeet3,
    "ieeet4": ieeet4,
    "ieeet5": ieeet5,
    "st1a": st1a,
    "esst2a": esst2a,
    "exst2": exst2,
    "esst3a": esst3a,
    "exst3": exst3,
    "st4b": st4b,
    "st5b": st5b,
    "st6b": st6b,
    "st7b": st7b,
    "st8c": st8c,
    "bbsex1": bbsex1,
    "external": external,
}
GOVERNORS: dict[str, Governor] = {
    "constant_power": read_either_way(of_speed(constant_power)),
    "constant_torque": of_speed(constant_torque),
    "tgov1": read_either_way(of_speed(tgov1)),
    "hygov": read_either_way(of_speed(hygov)),
    "gast": read_either_way(of_speed(gast)),
    "ieeeg1": read_either_way(ieeeg1),
    "wsieg1": read_either_way(wsieg1),
    "degov": read_either_way(degov),
    "degov1": read_either_way(degov1),
    "ggov1": read_either_way(ggov1),
    "ieesgo": read_either_way(ieesgo),
    "tgov3": read_either_way(tgov3),
    "gast2a": read_either_way(gast2a),
    "ieeeg2": read_either_way(ieeeg2),
    "ieeeg3": read_either_way(ieeeg3),
    "hygov2": read_either_way(hygov2),
    "pidgov": read_either_way(pidgov),
    "wpidhy": read_either_way(wpidhy),
    "wshygp": read_either_way(wshygp),
    "wehgov": read_either_way(wehgov),
}
STABILIZERS: dict[str, Stabilizer | None] = {
    NONE: None,
    "pss1a": pss1a,
    "pss2a": pss2a,
    "pss2b": pss2b,
    "pss2c": pss2c,
    "pss3b": pss3b,
    "pss4b": pss4b,
    "ieeest": ieeest,
    "st2cut": st2cut,
    "iee2st": iee2st,
    "stab2a": stab2a,
    "pod": pod,
    "pod_input": pod_input,
}
OELS: dict[str, Limiter | None] = {
    NONE: None,
    "maxex1": maxex1,
    "maxex2": maxex2,
    "oel2c": oel2c,
    "oel3c": oel3c,
    "oel4c": oel4c,
}
UELS: dict[str, Limiter | None] = {
    NONE: None,
    "mnlex2": mnlex2,
    "uel1": uel1,
    "uel2": uel2,
    "uel2c": uel2c,
}
"""Limiters of over- and of underexcitation."""

WITH_POD = {"_pod": False, "_pod_input": True}
"""Ends of a governor's name that give it a POD-P, and whether that acts on a frequency at an input."""

WITH_LOAD_CONTROL = "_lcfb1"
"""End of a governor's name that gives it a load controller LCFB1; one of `WITH_POD` may follow."""

WITHOUT_REFERENCE = (
    "degov",
)  # governors without a power reference, so without a POD-P and a load controller


@dataclass(frozen=True)
class Parts:
    """The parts of one generator, and its name."""

    machine: MachinePart
    exciter: Exciter
    governor: Governor
    stabilizer: Stabilizer | None
    limiters: Limiters
    names: tuple[str, ...]

    def model_name(self, suffix: str = "") -> str:
        """``synchronous_generator_<machine>_<exciter>_<governor>[_<stabiliser>][_<limiter>]``, with a suffix."""
        return "_".join(["synchronous_generator", *self.names, *([suffix] if suffix else [])])

    def title(self, kind: str) -> str:
        """The model's title; ``kind`` says how its stator is modelled."""
        return (
            f"Synchronous generator of {', '.join(self.names)} and a step-up transformer ({kind})"
        )


def chosen_parts(
    machine: str,
    exciter: str,
    governor: str,
    stabilizer: str,
    limiters: tuple[str, str] = (NONE, NONE),
) -> Parts:
    """The parts of these names; ``limiters``: of over- and of underexcitation."""
    oel, uel = limiters
    found = Parts(
        _part("machine", MACHINES, machine),
        _part("exciter", EXCITERS, exciter),
        _governor(governor),
        _part("stabilizer", STABILIZERS, stabilizer),
        Limiters(_part("oel", OELS, oel), _part("uel", UELS, uel)),
        (machine, exciter, governor, *(n for n in (stabilizer, *limiters) if n != NONE)),
    )
    if machine == "classical" and exciter != "manual":
        raise ValueError(
            f"exciter = {exciter!r}: the classical machine has no field winding that it could act on; take "
            "exciter = 'manual', or machine = 'two_axis', 'gensal' or 'genrou'"
        )
    if exciter == "manual" and stabilizer != NONE:
        raise ValueError(
            f"stabilizer = {stabilizer!r}: it acts on a voltage regulator, and manual excitation has none; leave the "
            "stabilizer out, or take another exciter"
        )
    acting = next((x for x in zip(("oel", "uel"), limiters, strict=True) if x[1] != NONE), None)
    if exciter == "manual" and acting is not None:
        kind, name = acting
        raise ValueError(
            f"{kind} = {name!r}: it acts on a voltage regulator, and manual excitation has none; leave the {kind} out, "
            "or take another exciter"
        )
    return found


def _governor(name: str) -> Governor:
    """The governor of a name, with a load controller and a POD-P where the name ends so."""
    end = next((end for end in WITH_POD if name.endswith(end)), "")
    controlled = name.removesuffix(end)
    plain = controlled.removesuffix(WITH_LOAD_CONTROL)
    if plain == name or plain not in GOVERNORS:
        found: Governor = _part("governor", GOVERNORS, name)
        return found
    if plain in WITHOUT_REFERENCE:
        what = "a POD" if end else "a load controller"
        raise ValueError(
            f"governor = {name!r}: {plain} has no power reference that {what} could move; take another governor, such "
            f"as {name.replace(plain, f'{plain}1', 1)}"
        )
    found = GOVERNORS[plain]
    if controlled != plain:
        found = with_load_control(found)
    return with_pod(found, far=WITH_POD[end]) if end else found


def _part(kind: str, parts: Mapping[str, Any], name: str) -> Any:
    if name not in parts:
        close = difflib.get_close_matches(name.lower(), parts, 1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise ValueError(f"there is no {kind} {name!r}; {hint}there are: {', '.join(parts)}")
    return parts[name]
