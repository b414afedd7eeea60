"""The code of the modules that Python-backed FMUs carry, which is compiled already where this package is installed.

To compile it anew is a fifth of what the first instance of such an FMU takes, and the same for each model."""

import marshal
import sys
from contextlib import suppress
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from importlib.util import MAGIC_NUMBER, cache_from_source, source_hash
from pathlib import Path

_COPIED = tuple(Path(__file__).with_name(name) for name in ("slave.py", "tape_kernel.py"))

# of a compiled module: it is named by its source's hash, which Python compares before it takes the code
_BY_HASH = 0b11


def lay_code(resources: Path) -> None:
    """Lay compiled code beside the modules in an FMU's folder that are copies of ours; others are left alone."""
    if sys.dont_write_bytecode or sys.pycache_prefix or not sys.implementation.cache_tag:
        return
    for module in resources.glob("*.py"):
        code = _compiled(module.read_bytes())
        if code is not None:
            place = Path(cache_from_source(module))
            with suppress(OSError):  # Python compiles it then
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(code)


@lru_cache(maxsize=8)
def _compiled(source: bytes) -> bytes | None:
    """The contents of the file that Python looks for beside a module of this text; None of another's text."""
    for file in _COPIED:
        if source == file.read_bytes():
            code = SourceFileLoader(file.stem, str(file)).get_code(file.stem)
            head = MAGIC_NUMBER + _BY_HASH.to_bytes(4, "little") + source_hash(source)
            return head + marshal.dumps(code)
    return None
