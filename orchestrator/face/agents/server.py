"""The verbs, offered over the Model Context Protocol with the official library."""

import asyncio
import json
import time
from collections.abc import Callable
from functools import wraps
from importlib.metadata import version
from typing import Any, ParamSpec, TypeVar

from mcp.server import MCPServer
from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ToolError, UnexpectedToolError
from mcp.server.stdio import stdio_server
from mcp.types import CallToolResult, InputRequiredResult, TextContent, Tool, ToolAnnotations
from pydantic import ValidationError

from orchestrator.core.errors import CosimError
from orchestrator.face.agents.question import Allowance, cancelled
from orchestrator.face.agents.streams import Incoming, Open, Outgoing
from orchestrator.face.agents.verbs import VERBS, Verbs

_TIMES = 2.0  # a question may wait as long for its turn as it may take
_TOLD_EVERY = 5.0  # [s] after which a client hears again of its question
_SHOWN = 40  # characters of an unknown argument's name that an error repeats

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
    server = VerbServer(
        "gfor-cosim", instructions=_INSTRUCTIONS, version=version("gfor-cosim"), log_level="WARNING"
    )
    server.seconds, server.patience = allowance.seconds, _TIMES * allowance.seconds
    verbs = Verbs(allowance)
    reading = ToolAnnotations(read_only_hint=True, open_world_hint=False)
    for name in VERBS:
        server.tool(name=name, annotations=reading, structured_output=True)(
            _with_errors(getattr(verbs, name))
        )
    return server


class VerbServer(MCPServer[Any]):
    """A server that refuses an argument which a verb has not, instead of an answer as if it were not given.

    Once its input has ended, it answers what was asked until then, within ``patience`` [s]. A question takes at most
    ``seconds`` [s]; a client that asks for it hears meanwhile how long ago it was asked."""

    seconds = 0.0
    patience = 0.0
    questions: Open | None = None  # those that have no answer yet, where streams bring them

    async def run_stdio_async(self) -> None:
        """Serve until the client has ended and has its answers."""
        async with stdio_server() as (incoming, outgoing):
            questions, server = Open(self.patience), self._lowlevel_server
            self.questions = questions
            told = Outgoing(outgoing, questions)
            heard = Incoming(incoming, outgoing, questions)
            await server.run(heard, told, server.create_initialization_options())

    async def list_tools(self) -> list[Tool]:
        """List the verbs; the schemas of their arguments are closed."""
        tools = await super().list_tools()
        for tool in tools:
            tool.input_schema["additionalProperties"] = False
        return tools

    async def call_tool(
        self, name: str, arguments: dict[str, Any], context: Context[Any, Any] | None = None
    ) -> CallToolResult | InputRequiredResult:
        """Answer a question whose arguments the verb has."""
        schemas = {tool.name: tool.input_schema for tool in await super().list_tools()}
        if name not in schemas:
            raise ToolError(
                f"{name[:_SHOWN]}: there is no such verb; there are: {', '.join(VERBS)}"
            )
        _check_names(name, arguments, schemas[name])
        telling = asyncio.create_task(self._tell_progress(name, context))
        if self.questions is not None and context is not None:
            cancelled.set(self.questions.cancelled(context.request_id))
        try:
            return _in_short(await super().call_tool(name, arguments, context))
        except UnexpectedToolError:
            raise
        except ToolError as error:
            raise ToolError(f"{name}: {_reason(error)}") from error.__cause__
        finally:
            telling.cancel()

    async def _tell_progress(self, verb: str, context: Context[Any, Any] | None) -> None:
        """Tell again and again how long ago a question was asked, until it is answered."""
        begin = time.monotonic()
        limit = f"it may wait {self.seconds:g} s for its turn, and then take {self.seconds:g} s"
        while context is not None:
            await asyncio.sleep(_TOLD_EVERY)
            since = time.monotonic() - begin
            await context.report_progress(since, None, f"{verb}: asked {since:.0f} s ago; {limit}")


def _in_short(
    answer: CallToolResult | InputRequiredResult,
) -> CallToolResult | InputRequiredResult:
    """Return an answer whose text is its JSON without blanks, of which the library's text is half."""
    if isinstance(answer, CallToolResult) and answer.structured_content is not None:
        text = json.dumps(answer.structured_content, ensure_ascii=False, separators=(",", ":"))
        answer.content = [TextContent(type="text", text=text)]
    return answer


def _check_names(verb: str, given: dict[str, Any], schema: dict[str, Any]) -> None:
    has, needs = list(schema.get("properties", {})), schema.get("required", ())
    unknown, missing = [n for n in given if n not in has], [n for n in needs if n not in given]
    if unknown:
        raise ToolError(
            f"{verb}: there is no argument {unknown[0][:_SHOWN]!r}; it takes: {', '.join(has) or 'none'}"
        )
    if missing:
        raise ToolError(f"{verb}: give {missing[0]!r}; it takes: {', '.join(has)}")


def _reason(error: ToolError) -> str:
    """Return why a verb refused, without the words that the library puts before it."""
    cause = error.__cause__
    if isinstance(cause, ValidationError):
        return "; ".join(dict.fromkeys(_fault(one["loc"], one["msg"]) for one in cause.errors()))
    return str(cause if isinstance(cause, ToolError) else error)


def _fault(place: tuple[int | str, ...], message: str) -> str:
    """Return one fault in words; of a value that no type fits, the library tells of each type."""
    if place[0] == "values" and len(place) > 2:
        return f"values.{place[1]}: give a finite number, true or false, or a text such as '200 MW'"
    return f"{'.'.join(map(str, place))}: {message}"


def _with_errors(verb: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return the verb with errors in words for whom the protocol has a place."""

    @wraps(verb)
    def answer(*arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return verb(*arguments, **named)
        except CosimError as error:
            raise ToolError(str(error)) from None

    return answer
