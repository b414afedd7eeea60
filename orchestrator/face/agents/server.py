"""The verbs, offered over the Model Context Protocol with the official library."""

from collections.abc import Callable
from functools import wraps
from importlib.metadata import version
from typing import Any, ParamSpec, TypeVar

from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import ToolAnnotations

from orchestrator.core.errors import CosimError
from orchestrator.face.agents.question import Allowance
from orchestrator.face.agents.verbs import Verbs

VERBS = (
    "cases",
    "modes",
    "run_summary",
    "screen_worst",
    "check",
    "scr",
    "sensitivities",
    "explain",
)

_P = ParamSpec("_P")
_R = TypeVar("_R")

_INSTRUCTIONS = """\
gfor-cosim answers whether grid-forming converters damp the oscillations of a grid. Begin with `cases`. Every figure
comes from coupled FMUs that were linearised or simulated for this question; tell units, and never more digits than are
given. `stable: null` means that it is not known: say so. `questions` and warnings belong to the answer.
"""


def make_server(allowance: Allowance) -> MCPServer[Any]:
    """Make the server of the verbs.

    Parameters
    ----------
    allowance
        Folders that may be read, the folder of results, and how long a question may take.
    """
    server: MCPServer[Any] = MCPServer(
        "gfor-cosim", instructions=_INSTRUCTIONS, version=version("gfor-cosim"), log_level="WARNING"
    )
    verbs = Verbs(allowance)
    reading = ToolAnnotations(read_only_hint=True, open_world_hint=False)
    for name in VERBS:
        server.tool(name=name, annotations=reading, structured_output=True)(
            _with_errors(getattr(verbs, name))
        )
    return server


def _with_errors(verb: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return the verb with errors in words for whom the protocol has a place."""

    @wraps(verb)
    def answer(*arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return verb(*arguments, **named)
        except CosimError as error:
            raise ToolError(str(error)) from None

    return answer
