"""Scripts that start processes must not run again in each of them: Python imports the script there."""

import ast
import sys
from types import FrameType

from orchestrator.core.errors import InputError


def require_main_guard() -> None:
    """Refuse to start processes from a script's own lines outside of ``if __name__ == "__main__":``.

    Each process would run these lines again, and try to start processes itself."""
    frame = _of_script(sys._getframe())
    if frame is None:
        return
    file, line = frame.f_code.co_filename, frame.f_lineno
    try:
        with open(file, encoding="utf-8") as text:
            tree = ast.parse(text.read())
    except (
        OSError,
        ValueError,
        SyntaxError,
    ):  # what is run is no file of Python, so that nothing imports it
        return
    if not any(_guards(node, line) for node in tree.body):
        raise InputError(
            f"{file}, line {line}: this script would run again in each worker process; put the call under "
            "`if __name__ == '__main__':`, or compute in this process (workers=1)"
        )


def _of_script(frame: FrameType | None) -> FrameType | None:
    """The frame of the main module's own lines, where other processes would import that module."""
    main = sys.modules.get("__main__")
    if main is None or getattr(main, "__file__", None) is None:
        return None
    module = getattr(main.__spec__, "name", "")  # of ``python -m package``
    if module.rpartition(".")[2] == "__main__":  # which Python imports in no process again
        return None
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_globals is vars(main):
            return frame if frame.f_code.co_filename == main.__file__ else None
        frame = frame.f_back
    return None


def _guards(node: ast.stmt, line: int) -> bool:
    """Return whether a statement that asks for the module's name holds the line."""
    if not isinstance(node, ast.If) or not node.lineno <= line <= (node.end_lineno or node.lineno):
        return False
    return any(isinstance(one, ast.Name) and one.id == "__name__" for one in ast.walk(node.test))
