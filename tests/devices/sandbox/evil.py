"""FMUs that do harm on purpose, in their first step."""

from pathlib import Path

from tests.devices.acceptance.gallery.build import Source, Variable

VARIABLES = (
    Variable("done", 0, "output", unit="1"),
    Variable("refused", 1, "output", unit="1"),
    Variable("gain", 2, "parameter", 1, "1", variability="tunable"),
)


def evil(act: str, value: object = 1, **defines: object) -> Source:
    """One that does what `evil.c` has under ``ACT_…``; ``defines`` are further ``ACT_…``."""
    macros = {
        "_GNU_SOURCE": 1,
        f"ACT_{act}": value,
        **{f"ACT_{name}": text for name, text in defines.items()},
    }
    return Source(
        act.lower(), str(Path(__file__).with_name("evil.c")), macros, VARIABLES, step_size="1e-2"
    )
