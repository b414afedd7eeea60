"""How the process of a foreign FMU ended, in words."""

import signal

import pytest

from orchestrator.devices.acceptance.checks.base import REMEDIES
from orchestrator.devices.sandbox.process_end import ProcessFault, fault_of_exit, last_line
from orchestrator.devices.sandbox.resource_limits import FLOODED, Limits

GIVEN_UP = (ProcessFault.HANG, ProcessFault.TAMPERING, ProcessFault.LEFT)
"""What gfor sees from outside and ends; the others are told by how the process ended."""

LIMITS = Limits(messages=100, output=2000)


@pytest.mark.parametrize(
    ("code", "fault", "how"),
    [
        (FLOODED, "output flood", "more than 100 log messages"),
        (-getattr(signal, "SIGXFSZ", 25), "output flood", "more than 2000 bytes written"),
        (-signal.SIGSEGV, "crash", "its process died with SIGSEGV"),
        (-200, "crash", "its process died with signal 200"),
        # access violation on Windows
        (0xC0000005, "crash", "its process died with code 0xc0000005"),
        (0x80000003, "crash", "its process died with code 0x80000003"),  # breakpoint on Windows
        (0, "exit", "it ended its process with exit code 0"),
        (255, "exit", "it ended its process with exit code 255"),
        (0x7FFFFFFF, "exit", "it ended its process with exit code 2147483647"),
    ],
)
@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="signals of POSIX")
def test_an_exit_code_in_words(code, fault, how):
    assert fault_of_exit(code, LIMITS) == (fault, how)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (b"", ""),
        (b"first\nlast words \n\n", "last words"),
        (b"\xff!\n", "\ufffd!"),
        (b"a" * 5000, "a" * 300),
        (None, ""),
    ],
)
def test_the_last_line_of_an_output(tmp_path, written, words):
    if written is not None:
        (tmp_path / "output").write_bytes(written)
    assert last_line(tmp_path / "output") == words


def test_each_end_of_a_process_has_its_remedy():
    """`gfor fmu check` of an FMU that forks ended with `KeyError: 'too many processes'`."""
    assert [fault for fault in ProcessFault if fault not in REMEDIES] == []
    found = {fault_of_exit(code, LIMITS)[0] for code in (*range(-64, 256), 0xC0000005)}
    assert found == set(ProcessFault) - {*GIVEN_UP}
