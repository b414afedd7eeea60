"""The process that reads a vendor's DLL for `vendor_files`: closed off before the DLL is loaded.

A DLL for Windows is loaded by a program under Wine."""

import json
import sys
from pathlib import Path

from fmus.vendor_dll.memory import LocalLibrary
from fmus.vendor_dll.reading import answer_for, texts_in
from orchestrator.core.errors import InputError
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.access_restriction import confine_alone
from orchestrator.devices.sandbox.compiled_programs import compile_programs
from orchestrator.devices.sandbox.kernel_calls import end_with_starter


def _files(texts: dict[str, str] | None) -> list[Path]:
    """Those that text parameters name, which it may read."""
    return [
        path for path in map(Path, (texts or {}).values()) if path.is_absolute() and path.is_file()
    ]


def _read(library: Path, answer: Path, texts: dict[str, str] | None) -> None:
    confine_alone(answer.parent, [library, *_files(texts)])
    answer_for(lambda note: LocalLibrary(library, note), answer, texts)


def _read_under_wine(library: Path, answer: Path, texts: dict[str, str] | None) -> None:
    programs = compile_programs()
    confine_alone(answer.parent, [library, *programs, *_files(texts)], windows=True)
    if texts is not None:
        files = set(map(str, _files(texts)))
        texts = {
            n: f"Z:{text}".replace("/", "\\") if text in files else text
            for n, text in texts.items()
        }
    from orchestrator.devices.sandbox.wine_program import WineLibrary  # noqa: PLC0415 - numpy brings threads, so after

    answer_for(lambda note: WineLibrary(library, note), answer, texts)
    wine.in_process[0].close()


if __name__ == "__main__":
    end_with_starter()  # a DLL that never comes back would run for ever once gfor was killed
    given, found = Path(sys.argv[1]), Path(sys.argv[2])
    read = (
        _read_under_wine if sys.platform == "linux" and given.read_bytes()[:2] == b"MZ" else _read
    )
    try:
        read(given, found, texts_in(sys.argv))
    except (wine.NoWineError, InputError) as error:
        found.write_text(json.dumps({"error": str(error)}), encoding="utf-8")
