"""Modules that an FMU carries and that are installed as well are not compiled again."""

import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

from fmus.toolchain import slave_code
from fmus.toolchain.slave_code import lay_code
from fmus.toolchain.temporary import remove
from orchestrator.devices.fmi.unpacked import extract_with_code

SLAVE = Path(slave_code.__file__).with_name("slave.py").read_text(encoding="utf-8")


class Counting(SourceFileLoader):
    """Loads as Python does, and counts what it compiles."""

    compiled = 0

    def source_to_code(self, *given, **named):
        self.compiled += 1
        return super().source_to_code(*given, **named)


@pytest.fixture(autouse=True)
def writing(monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)


def loader_of(module: Path) -> Counting:
    return Counting(module.stem, str(module))


def test_a_copy_of_the_slave_is_not_compiled(tmp_path):
    module, other = tmp_path / "carried.py", tmp_path / "other.py"
    module.write_text(SLAVE, encoding="utf-8")
    other.write_text("x = 1\n", encoding="utf-8")
    lay_code(tmp_path)
    loader = loader_of(module)
    code = loader.get_code("carried")
    assert loader.compiled == 0
    assert code == compile(module.read_bytes(), str(module), "exec", dont_inherit=True)
    assert code.co_filename == str(module)
    assert {
        constant.co_filename for constant in code.co_consts if hasattr(constant, "co_code")
    } == {str(module)}
    assert not [*(tmp_path / "__pycache__").glob("other*")]


def test_a_copy_that_was_changed_since_is_compiled(tmp_path):
    module = tmp_path / "carried.py"
    module.write_text(SLAVE, encoding="utf-8")
    lay_code(tmp_path)
    module.write_text("changed = True\n", encoding="utf-8")
    loader = loader_of(module)
    assert "changed" in loader.get_code("carried").co_names
    assert loader.compiled == 1


def test_an_fmu_is_unpacked_with_the_code_of_its_slave(fmu_path):
    folder = extract_with_code(fmu_path("infinite_bus"))
    (module,) = (folder / "resources").glob("gfor_cosim_class_*.py")
    loader = loader_of(module)
    loader.get_code(module.stem)
    remove(folder)
    assert loader.compiled == 0


@pytest.mark.parametrize(
    ("name", "value"), [("dont_write_bytecode", True), ("pycache_prefix", "x")]
)
def test_where_python_keeps_no_code_beside_modules_none_is_laid(tmp_path, monkeypatch, name, value):
    monkeypatch.setattr(sys, name, value)
    (tmp_path / "carried.py").write_text(SLAVE, encoding="utf-8")
    lay_code(tmp_path)
    assert not (tmp_path / "__pycache__").exists()
