"""The form of a binding file. The module `binding` works out its meaning."""

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from orchestrator.core.toml_files import Table

# what `gfor fmu bind` writes for an unknown value; a binding that still has it is refused
REQUIRED = "REQUIRED"


class DraftedTable(Table):
    """A table of a binding; it is refused as long as a value is left to fill in."""

    @model_validator(mode="before")
    @classmethod
    def _nothing_left_to_fill_in(cls, values: Any) -> Any:
        given = values.items() if isinstance(values, dict) else ()
        left = [k for k, v in given if isinstance(v, str) and v.startswith(REQUIRED)]
        if left:
            raise ValueError(
                f"still to be filled in: {', '.join(left)}; the comments in the draft say what is meant"
            )
        return values


class FileTable(DraftedTable):
    file: str | None = None
    guid: str | None = None
    kind: Literal["converter", "machine"] | None = None


class RatingTable(DraftedTable):
    """The FMU as delivered: rating, rated line-to-line voltage at its port, rated frequency, largest current.

    ``frequency_range``: deviation of the frequency up to which its active power answers it; any where left out."""

    S_n: str | float
    V_n: str | float | None = None
    f_n: str | float = "50 Hz"
    I_max: str | float | None = None
    frequency_range: str | float | None = None


class QuantityTable(DraftedTable):
    """Unit and base of a variable; the FMU's declared unit where ``unit`` is left out."""

    unit: str | None = None
    base: str | None = None


class PhasorTable(QuantityTable):
    form: Literal["rectangular", "dq", "qd", "polar", "abc", "power"]
    variables: list[str]
    value: (
        Literal["line-to-line rms", "line-to-line peak", "phase rms", "phase peak", "rms", "peak"]
        | None
    ) = None
    angle_unit: Literal["rad", "deg"] | None = None
    frame_angle: str | float = 0.0
    moment: Literal["middle", "begin"] | None = None
    signs: list[Literal[1, -1]] | None = None
    direction: Literal["into the grid", "into the converter"] = "into the grid"

    @field_validator("variables")
    @classmethod
    def _some(cls, names: list[str]) -> list[str]:
        left = [n for n in names if n.startswith(REQUIRED)]
        if left or not names:
            raise ValueError("still to be filled in: the names of the FMU's variables")
        return names


class StartTable(QuantityTable):
    """A variable of the FMU that takes a start value of the power flow."""

    variable: str
    sign: Literal[1, -1] = 1
    value: Literal["line-to-line rms", "line-to-line peak", "phase rms", "phase peak"] | None = None


class SignalTable(QuantityTable):
    """A variable of the FMU that is shown under a name and in a unit of ours."""

    variable: str


class BindingTable(DraftedTable):
    fmu: FileTable = Field(default_factory=FileTable)
    rating: RatingTable
    voltage: PhasorTable
    current: PhasorTable
    start: dict[str, StartTable | list[StartTable]] = {}
    signals: dict[str, SignalTable] = {}
    parameters: dict[str, float | bool | str] = {}
    inputs: dict[str, float | bool | str] = {}
