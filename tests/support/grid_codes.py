"""A changed grid code in the place of an installed one."""

from orchestrator.studies.certification.codes.known import KNOWN


def replace_code(monkeypatch, code):
    """Let gfor find this code under its key for the length of a test."""
    entry, _ = KNOWN._objects[code.key]
    monkeypatch.setitem(KNOWN._objects, code.key, (entry, code))
