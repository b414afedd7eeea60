"""Environment variables that the process of a foreign library is given: a short list, without keys or passwords."""

import os
from collections.abc import Mapping

_KEPT = (
    "PATH",
    "LANG",
    "LANGUAGE",
    "TZ",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "DYLD_FALLBACK_LIBRARY_PATH",
    "SYSTEMROOT",
    "WINDIR",
    "COMSPEC",
    "PATHEXT",
    "NUMBER_OF_PROCESSORS",
    "PROCESSOR_ARCHITECTURE",
)
_KEPT_BEGINNINGS = ("LC_", "OMP_", "OPENBLAS_", "MKL_", "KMP_", "PYTHON")
_NOT_FOR_IT = ("PYTHONSTARTUP", "PYTHONINSPECT", "PYTHONBREAKPOINT")

_FOR_THE_CACHE = ("HOME", "USERPROFILE", "XDG_CACHE_HOME", "LOCALAPPDATA", "GFOR_COSIM_CACHE")
"""They say where compiled adapters lie; `apply_limits` takes them away before the FMU is loaded."""

PASSED_ON = "GFOR_COSIM_FMU_ENVIRONMENT"
"""Names, with commas between them, of further variables that FMUs need: where a licence is, for instance."""


def environment(of: Mapping[str, str] | None = None) -> dict[str, str]:
    """Keep part of an environment, by default of this process's own: a short list without keys or passwords."""
    own = os.environ if of is None else of
    more = [name.strip() for name in own.get(PASSED_ON, "").split(",")]
    return {
        name: value
        for name, value in own.items()
        if name in _KEPT
        or name in _FOR_THE_CACHE
        or name in more
        or (name.startswith(_KEPT_BEGINNINGS) and name not in _NOT_FOR_IT)
    }
