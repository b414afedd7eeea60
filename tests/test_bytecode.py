"""What is compiled for the tests is kept, and compiled by one worker."""

import os
import sys
from pathlib import Path

from tests.support import bytecode


def test_an_image_that_refuses_bytecode_does_not_make_each_process_compile(monkeypatch):
    monkeypatch.setenv(bytecode.REFUSAL, "1")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    bytecode.keep()
    assert not sys.dont_write_bytecode
    assert bytecode.REFUSAL not in os.environ


def test_workers_import_each_file_of_tests_once_among_them(monkeypatch):
    imported = []
    monkeypatch.setattr(bytecode, "import_module", imported.append)
    for worker in range(3):
        bytecode.import_share(worker, 3, lambda path: path.name != "test_form.py")
    assert len(imported) == len(set(imported)) == len(list(bytecode.TESTS.rglob("test_*.py"))) - 1
    assert __name__ in imported


def test_a_file_that_cannot_be_imported_is_left_for_pytest(monkeypatch):
    tried = []

    def fail(name):
        tried.append(name)
        raise ImportError(name)

    monkeypatch.setattr(bytecode, "import_module", fail)
    bytecode.import_share(0, 1, Path.exists)
    assert len(tried) > 1
