"""The request for a certificate, and its departures from the norm's own test."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.cases.form.schema import Value
from orchestrator.core.asked import as_number
from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.options import Option
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.port_mapping import PHASOR_PORT, BoundDescription
from orchestrator.devices.fmi.values import as_text
from orchestrator.studies.black_box.port import bench_at

# values of X_L in the norm [pu, 100 MVA]
REACTANCES = (0.01, *(round(0.05 * k, 2) for k in range(1, 13)))
PODS = ("none", "p", "q", "pq")
STUDY = ("sg1", "sg2", "grid")  # components of the study that are not the converter
GIVEN = ("S_n", "S_base", "f_n", "P_0", "Q_0", "v_0", "theta_0", "connected")
"""Values of the converter that a study gives it: that of the norm, and the bench of the other codes."""
STEP = 1e-4
"""Communication step [s] with which a device is asked."""
_PORT = ("v_re", "v_im", "i_re", "i_im")


@dataclass(frozen=True)
class CertificationRequest:
    fmu: Path
    binding: Path | None = None
    values: Mapping[str, Value] = field(default_factory=dict)
    # the active damping controllers, as one of `PODS`; None to read them from ``pod_p.enabled`` and ``pod_q.enabled``.
    pod: str | None = None
    reactances: Sequence[float] = REACTANCES
    # values of the study's other components, by ``component.variable``.
    study_values: Mapping[str, Value] = field(default_factory=dict)
    # identify the converter for the modes even if it shows its states. A converter that hides them is always
    # identified.
    black_box: bool = False

    def check(self) -> None:
        """Check that the files exist, and that no value is set which the norm itself varies."""
        for file in (self.fmu, *([self.binding] if self.binding else [])):
            if not file.is_file():
                raise InputError(
                    f"{file}: there is no such file; give the path of an .fmu, and with "
                    + Option.BINDING
                    + " of a .toml"
                )
            if not file.name.isascii() and file.name != file.name.encode(errors="replace").decode():
                raise InputError(
                    f"{str(file)!a}: its name is not UTF-8, so that no report can state it; rename it"
                )
        if "grid.X_L" in self.study_values:
            raise InputError(
                Option.SET
                + " grid.X_L: the test varies it; choose its values with "
                + Option.REACTANCES
            )

    @property
    def departures(self) -> tuple[str, ...]:
        changed = {f"converter.{name}": self.values[name] for name in GIVEN if name in self.values}
        return tuple(
            f"{name} = {as_text(value)}" for name, value in {**self.study_values, **changed}.items()
        )


def rated_frequency(request: CertificationRequest, wanted: float) -> float:
    """Frequency at which a test runs [Hz]: the code's where the FMU can be set to it, else the FMU's own."""
    set_by_user = request.values.get("f_n")
    if isinstance(set_by_user, int | float):
        return float(set_by_user)
    description = bound_fmu(request.fmu, request.binding)
    if isinstance(description, BoundDescription):
        return description.port.f_n
    return wanted if "f_n" in description.variables else 50.0


def refuse_phasors(request: CertificationRequest) -> None:
    """Refuse a phasor model, which the tests' networks would fail for what it is and not for what it does.

    Raises an `InputError` if the FMU gives an emf behind an admittance."""
    if {*PHASOR_PORT} <= {*bound_fmu(request.fmu, request.binding).outputs}:
        emf = f"its outputs {', '.join(PHASOR_PORT)} are an emf behind an admittance"
        raise InputError(_phasors_refused(request, emf))


def refuse_what_follows_at_once(request: CertificationRequest) -> None:
    """Refuse a phasor model under other names: its current answers the voltage before any step.

    An FMU that cannot be asked so is not refused here: the tests tell what is wrong with it.
    Raises an `InputError` if most of what its current answers over a period is there at once."""
    description = bound_fmu(request.fmu, request.binding)
    if not {*_PORT} <= {*description.inputs, *description.outputs}:
        return
    try:
        follows = bench_at(description, request.values, STEP).follows_at_once()
    except CosimError:
        return
    if follows:
        answers = "its current answers a change of the voltage before any step"
        raise InputError(_phasors_refused(request, answers))


def _phasors_refused(request: CertificationRequest, because: str) -> str:
    return (
        f"{request.fmu}: it is a phasor model ({because}), and the networks of the codes' tests are EMT ones, whose "
        "voltage its current would follow at once; give the converter's EMT model. `gfor modes` tells the damping "
        "of a phasor model in a case whose network is of phasors"
    )


def read_reactances(text: str) -> tuple[float, ...]:
    """Different reactances of a line [pu], separated by commas."""
    values = tuple(as_number(part) for part in text.split(","))
    if not all(1e-3 <= value <= 10 for value in values) or len(set(values)) < len(values):
        raise ValueError(
            f"{text!r} are no reactances; write different numbers from 0.001 to 10, such as 0.1,0.3"
        )
    return values


def row_of(X_L: float) -> str:
    """The row of NTS 631 that a line reactance [pu] is; as many digits as `same_reactance` tells apart."""
    return f"X_L = {X_L:.9g} pu"


def same_reactance(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-9)
