"""The process that reads a vendor's DLL for `vendor_files`: closed off before the DLL is loaded.

A DLL for Windows is loaded by a program under Wine.
"""

import json
import sys
from pathlib import Path

from fmus.vendor_dll.memory import LocalLibrary
from fmus.vendor_dll.reading import answer_for
from orchestrator.errors import InputError
from orchestrator.fmi import wine
from orchestrator.fmi.confinement import LAYERS, Means, confine


def _read(library: Path, answer: Path, *, with_trial: bool) -> None:
    confine(Means(), LAYERS, answer.parent, [library])
    answer_for(lambda note: LocalLibrary(library, note), answer, with_trial=with_trial)


def _read_under_wine(library: Path, answer: Path, *, with_trial: bool) -> None:
    from orchestrator.fmi.wine_program import WineLibrary, compile_programs  # noqa: PLC0415 - numpy, for others in vain

    try:
        programs = compile_programs()
        confine(Means(), LAYERS, answer.parent, [library, *programs], windows=True)
    except (wine.NoWineError, InputError) as error:
        answer.write_text(json.dumps({"error": str(error)}), encoding="utf-8")
        return
    answer_for(lambda note: WineLibrary(library, note), answer, with_trial=with_trial)
    wine.in_process[0].close()


if __name__ == "__main__":
    given, found = Path(sys.argv[1]), Path(sys.argv[2])
    read = _read_under_wine if sys.platform == "linux" and given.read_bytes()[:2] == b"MZ" else _read
    read(given, found, with_trial=sys.argv[3:] == ["--try"])
