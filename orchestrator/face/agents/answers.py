"""The answers that an agent gets: figures with units. Their JSON Schema is made from these classes."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, Field

DIGITS = 6
"""Significant digits of a figure: more than a model is right to, and a third of the characters."""

Figure = Annotated[float, AfterValidator(lambda figure: float(f"{figure:.{DIGITS}g}"))]
Part = dict[str, Figure]


class FrequencyAndDamping(BaseModel):
    """A mode by its two figures."""

    frequency_hz: Figure
    damping_percent: Figure


class ModeAnswer(BaseModel):
    """An eigenvalue of the coupled system, with its eigenvector and what takes part."""

    name: str | None = Field(description="the field's name of the mode, if it has one")
    frequency_hz: Figure = Field(description="Im λ / 2π [Hz]")
    damping_percent: Figure = Field(
        description="damping ratio −Re λ / |λ| [%]; negative if it grows"
    )
    real: Figure = Field(description="Re λ [1/s]")
    imag: Figure = Field(description="Im λ [rad/s]")
    participation: Part = Field(
        description="state: magnitude of its participation factor; the largest first, five unless `parts` says more"
    )
    shape: dict[str, tuple[Figure, Figure]] = Field(
        description="machine: magnitude and angle [deg] of its speed in the right eigenvector, the largest at 1 and 0; "
        "five unless `parts` says more"
    )
    machines_left_out: int = Field(description="machines that move less in it and are not listed")


class ScenarioModesAnswer(BaseModel):
    """The modes of one scenario in a range of frequencies, and whether all of its eigenvalues are damped."""

    scenario: str
    stable: bool | None = Field(description="of all eigenvalues; null if it is not known")
    verdict: str = Field(description="the verdict in one sentence, with its cause")
    eigenvalues: int = Field(description="how many eigenvalues the verdict rests on")
    frequency_range_hz: tuple[Figure, Figure] = Field(
        description="the frequencies of the modes that are listed [Hz]; the verdict is of all"
    )
    modes: list[ModeAnswer] = Field(
        description="oscillatory modes in that range that have a name or are damped least, the least damped first"
    )
    left_out: int = Field(
        description="modes in that range that are not listed, "
        "all better damped than those without a name; `most` lists more"
    )
    outside_range: int | None = Field(
        description="oscillatory modes outside of that range, which `frequencies_hz` asks for; null if they are not "
        "all known"
    )
    least_damped_outside: FrequencyAndDamping | None = Field(
        description="the least damped of those outside of the range; null if there is none"
    )


class ModesAnswer(BaseModel):
    """Modes of a case's scenarios, from its coupled FMUs linearised around their steady state."""

    case: str
    scenarios: list[ScenarioModesAnswer] = Field(
        description="the one that was asked for, else the case's first"
    )
    others: dict[str, str] = Field(
        description="scenario: its verdict; ask for it by name to get its modes"
    )
    questions: list[str] = Field(
        description="what in the input deserves a look before the figures are believed"
    )


class CasesAnswer(BaseModel):
    """Cases that can be asked about."""

    built_in: dict[str, str] = Field(description="name: title")
    files: list[str] = Field(description="case files in the given folders")


class RunSummaryAnswer(BaseModel):
    """The end of a run of a scenario."""

    scenario: str
    stable: bool | None = Field(description="null if the run does not tell")
    verdict: str
    remark: str = Field(description="why the verdict is what it is")
    frequency_hz: Figure | None = Field(description="of the mode that decides [Hz]")
    damping_percent: Figure | None = Field(description="its damping ratio [%]")
    components: Part = Field(description="who takes part in that mode")
    stop_time_s: Figure


class ScreenedModeAnswer(BaseModel):
    """A mode followed over operating points and outages, where it is damped least."""

    name: str
    frequency_hz: Figure
    damping_percent: Figure
    point: str
    outage: str
    participation: Part


class ScreeningAnswer(BaseModel):
    """The worst of a case's operating points and outages."""

    scenario: str
    stable: bool | None = Field(description="of all points and outages; null if some is not known")
    computed: int = Field(description="points and outages that were computed")
    unstable: list[str] = Field(description="points and outages that are unstable")
    failures: list[str] = Field(description="those without a result, with the reason")
    worst: list[ScreenedModeAnswer] = Field(description="the least damped modes, worst first")


class CheckRowAnswer(BaseModel):
    """One acceptance check of an FMU."""

    check: str
    question: str
    verdict: str
    evidence: str


class CheckAnswer(BaseModel):
    """The verdict of the checks on an FMU: can it be trusted in a co-simulation?"""

    fmu: str
    faults: list[str] = Field(description="what was found wrong; empty if nothing was")
    not_judged: list[str] = Field(description="checks without a verdict, with the reason")
    checks: list[CheckRowAnswer]


class BusStrengthAnswer(BaseModel):
    """Short-circuit strength of a bus, and SCR of a converter there."""

    bus: str
    s_sc_mva: Figure = Field(description="initial three-phase short-circuit power [MVA]")
    scr: Figure | None = Field(
        description="short-circuit ratio of the converters there; null without one"
    )


class StrengthsAnswer(BaseModel):
    """Short-circuit strength, weakest bus first."""

    scenario: str
    convention: str = Field(description="by which convention the short-circuit power is computed")
    buses: list[BusStrengthAnswer]


class InfluenceAnswer(BaseModel):
    """How a parameter of a running FMU moves a mode."""

    parameter: str
    value: Figure
    unit: str | None = Field(description="unit of the value; null if it has none")
    damping_points_per_unit: Figure | None = Field(
        description="change of the damping ratio [percentage points] for each unit by which the parameter grows"
    )
    damping_points_per_percent: Figure | None = Field(
        description="the same for each percent of its value; null if the value is 0"
    )


class SensitivitiesAnswer(BaseModel):
    """Which parameters move a mode, the strongest first."""

    scenario: str
    mode_frequency_hz: Figure
    mode_damping_percent: Figure
    influences: list[InfluenceAnswer]


class ExplanationAnswer(BaseModel):
    """Why a scenario has the verdict that it has."""

    scenario: str
    stable: bool | None
    verdict: str
    because: list[str] = Field(
        description="what decides, one sentence each: the modes that grow, or else the least damped one, and who takes "
        "part in it; or why the verdict is not known"
    )
    doubts: list[str] = Field(
        description="warnings, and questions about the input, to look at before the verdict is believed"
    )
