"""``gfor mcp``, asked by the client of the official library, over the standard streams of a process."""

import json
import subprocess
import sys
import threading

import anyio
import jsonschema
import pytest

import orchestrator as gfor
from orchestrator.face.agents.question import Allowance, NoAnswerError
from tests.support.late import LateLibrary

mcp, streams = LateLibrary("mcp"), LateLibrary("mcp.client.stdio")
owner = LateLibrary("orchestrator.face.agents.server")  # which imports mcp
ours = LateLibrary("orchestrator.face.agents.streams")  # as well
exceptions = LateLibrary("mcp.server.mcpserver.exceptions")

VERBS = {
    "cases",
    "modes",
    "run_summary",
    "screen_worst",
    "check",
    "scr",
    "sensitivities",
    "explain",
}


def ask(folder, *questions):
    """Return the server's tools, and its result for each question (verb, arguments)."""

    async def talk():
        server = mcp.StdioServerParameters(
            command=sys.executable,
            args=["-m", "orchestrator.face.cli", "mcp", "--root", str(folder)],
        )
        async with mcp.Client(streams.stdio_client(server)) as client:
            tools = (await client.list_tools()).tools
            return tools, [await client.call_tool(verb, given) for verb, given in questions]

    return anyio.run(talk)


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """A session with what agents get wrong elsewhere: modes without shapes, or sorted apart from participations."""
    folder = tmp_path_factory.mktemp("agents")
    (folder.parent / "secret.toml").write_text(
        "[components.a]\nmodel = 'secret'\n", encoding="utf-8"
    )
    return folder, ask(
        folder,
        ("cases", {}),
        ("modes", {"case": "kundur", "scenario": "manual"}),
        ("modes", {"case": "../secret.toml"}),
        ("explain", {"case": "kundur", "scenario": "--out=x"}),
        ("modes", {"case": "two_area", "set": {"gfor.pod_p.K": 0}}),
        ("explain", {"case": "two_area"}),
        ("scr", {"case": 5}),
        ("power_flow", {}),
        ("modes", {"case": "two_area"}),
    )


def test_the_end_of_the_input_leaves_no_question_unanswered(tmp_path):
    """Who wrote questions into a pipe got no answer to the last one; a line that is no JSON was dropped, and a
    cancellation without an id ended the server."""
    asked = [
        {
            "id": 1,
            "method": "initialize",
            "params": {
                "protocolVersion": "2025-06-18",
                "capabilities": {},
                "clientInfo": {"name": "pipe", "version": "1"},
            },
        },
        {"method": "notifications/initialized"},
        {"method": "notifications/cancelled", "params": {"requestId": {"no": "id"}}},
        {"id": 2, "method": "tools/call", "params": {"name": "scr", "arguments": {"case": "no"}}},
        {
            "id": 3,
            "method": "tools/call",
            "params": {"name": "explain", "arguments": {"case": "two_area", "scenario": "no"}},
        },
    ]
    lines = [json.dumps({"jsonrpc": "2.0", **one}) for one in asked]
    found = subprocess.run(
        [sys.executable, "-m", "orchestrator.face.cli", "mcp", "--root", str(tmp_path)],
        input="\n".join([*lines, "{no JSON", "[1]", ""]),
        capture_output=True,
        text=True,
        check=True,
    )
    answers = [json.loads(line) for line in found.stdout.splitlines()]
    errors = [one["error"]["code"] for one in answers if one["id"] is None]
    assert sorted(one["id"] for one in answers if one["id"] is not None) == [1, 2, 3]
    assert errors == [-32700, -32600]
    assert "scenario" in str(next(one for one in answers if one["id"] == 3))
    assert [*tmp_path.iterdir()] == []


def test_a_long_question_tells_its_progress_and_others_are_answered_meanwhile(
    tmp_path, monkeypatch
):
    """Minutes without a word, as with a network of many thousand buses, looked like a server that hangs."""
    may_end = threading.Event()

    def asked(words, _):
        assert may_end.wait(60)
        raise NoAnswerError(f"gfor {words[0]}: no answer within 7 s")

    monkeypatch.setattr("orchestrator.face.agents.verbs.ask", asked)
    monkeypatch.setattr("orchestrator.face.agents.server._TOLD_EVERY", 0.02)
    told, found = [], {}

    async def talk():
        heard = anyio.Event()

        async def progress(seconds, total, text):
            told.append((seconds, text))
            heard.set()

        async with mcp.Client(owner.make_server(Allowance((tmp_path,), tmp_path, 7.0))) as client:

            async def long():
                given = {"case": "two_area", "scenario": "base"}
                found["long"] = await client.call_tool("modes", given, progress_callback=progress)

            async with anyio.create_task_group() as group:
                group.start_soon(long)
                await heard.wait()
                found["short"] = await client.call_tool("cases", {})
                assert "long" not in found
                may_end.set()

    anyio.run(talk)
    assert not found["short"].is_error
    assert found["long"].is_error
    assert "no answer within 7 s" in found["long"].content[0].text
    seconds, text = told[0]
    assert 0 < seconds < 60
    assert text == "modes: asked 0 s ago; it may wait 7 s for its turn, and then take 7 s"


def test_every_verb_only_reads_and_has_a_schema_with_units(answers):
    _, (tools, (listed, found, *_)) = answers
    assert {tool.name for tool in tools} == VERBS
    assert all(tool.annotations.read_only_hint and tool.description for tool in tools)
    schemas = {tool.name: tool.output_schema for tool in tools}
    assert "[Hz]" in str(schemas["modes"])
    for name, result in (("cases", listed), ("modes", found)):
        jsonschema.validate(result.structured_content, schemas[name])


@pytest.mark.slow
def test_the_built_in_cases_are_listed_with_their_titles(answers):
    _, (_, (listed, *_)) = answers
    found = listed.structured_content["built_in"]
    assert set(found) == set(gfor.built_in_cases())
    assert all(found.values())


@pytest.mark.slow
def test_each_mode_of_kundurs_system_has_its_own_shape_and_participations(answers):
    """The question of a regulator to another server, which answered with empty vectors (PowerMCP, issue 52)."""
    _, (_, (_, result, *_)) = answers
    (scenario,) = result.structured_content["scenarios"]
    expected = gfor.load("kundur").scenario("manual").modes()
    for mode, own in zip(scenario["modes"], expected, strict=True):
        assert mode["frequency_hz"] == float(f"{own.frequency_hz:.6g}")
        assert mode["damping_percent"] == float(f"{own.damping_percent:.6g}")
        assert [*mode["participation"]] == [state for state, _ in own.participation[:5]]
        assert set(mode["shape"]) == {"sg1", "sg2", "sg3", "sg4"}
    inter_area = min(scenario["modes"], key=lambda mode: mode["frequency_hz"])
    angles = {name: angle for name, (_, angle) in inter_area["shape"].items()}
    assert abs(angles["sg1"] - angles["sg3"]) == pytest.approx(180, abs=40)
    assert abs(angles["sg1"] - angles["sg2"]) < 20


@pytest.mark.slow
def test_modes_of_a_case_are_those_of_one_scenario_and_short(answers):
    """All scenarios of a case with all that takes part once filled an agent's window: 69,000 characters."""
    _, (_, (*_, result)) = answers
    found = result.structured_content
    assert [one["scenario"] for one in found["scenarios"]] == ["base"]
    assert set(found["others"]) == {"gfor", "pod_p", "pod_q", "pod_pq"}
    assert all(verdict.startswith("stable") for verdict in found["others"].values())
    assert len(result.content[0].text) < 6000


@pytest.mark.slow
def test_hostile_arguments_are_refused_in_words(answers):
    folder, (_, (_, _, outside, option, *_)) = answers
    assert outside.is_error
    assert "no such file in the folders that may be read" in outside.content[0].text
    assert "secret" not in outside.content[0].text.replace("../secret.toml", "")
    assert option.is_error
    assert "does not begin with '-'" in option.content[0].text
    assert not (folder / "x").exists()


@pytest.mark.slow
def test_an_argument_that_a_verb_has_not_is_refused_and_never_dropped(answers):
    _, (tools, (*_, unknown, missing, _, _, _)) = answers
    assert unknown.is_error
    assert (
        "modes: there is no argument 'set'; it takes: case, scenario, values, frequencies_hz"
        in (unknown.content[0].text)
    )
    assert missing.is_error
    assert "explain: give 'scenario'" in missing.content[0].text
    assert all(tool.input_schema["additionalProperties"] is False for tool in tools)


@pytest.mark.slow
def test_every_refusal_begins_with_its_verb_and_repeats_no_value(answers):
    _, (_, (*_, outside, option, unknown, missing, number, nothing, _)) = answers
    told = [one.content[0].text for one in (outside, option, unknown, missing, number, nothing)]
    assert [text.partition(": ")[0] for text in told] == [
        "modes",
        "explain",
        "modes",
        "explain",
        "scr",
        "power_flow",
    ]
    assert told[-2] == "scr: case: Input should be a valid string"
    assert told[-1].endswith("there are: " + ", ".join(owner.VERBS))


@pytest.mark.parametrize("value", [None, [1.0]])
def test_a_value_that_is_none_is_refused_in_one_sentence(tmp_path, value):
    server = owner.make_server(Allowance((tmp_path,), tmp_path / "results", 1.0))
    given = {"case": "two_area", "values": {"gfor.pod_p.K": value}}
    with pytest.raises(
        exceptions.ToolError,
        match=r"^modes: values\.gfor\.pod_p\.K: give a finite number, true or false, or a text such as '200 MW'$",
    ):
        anyio.run(server.call_tool, "modes", given)


@pytest.mark.parametrize(
    ("token", "is_refused"),
    [("a", False), (7, False), (True, True), (1.5, True), (None, True), ({"a": 1}, True)],
)
def test_a_token_of_progress_that_is_none_is_refused_in_words(token, is_refused):
    """The library says "Invalid request parameters", and not which."""
    given = {"name": "cases", "_meta": {"progressToken": token}}
    message = ours.JSONRPCRequest(jsonrpc="2.0", id=4, method="tools/call", params=given)
    refusal = ours.wrong_token(message)
    assert (refusal is not None) == is_refused
    if refusal is not None:
        assert (refusal.id, refusal.error.code) == (4, ours.INVALID_PARAMS)
        assert refusal.error.message.startswith("_meta.progressToken: give a text")


def test_a_cancel_reaches_the_question_that_it_names():
    questions = ours.Open(1.0)
    questions.came(ours.JSONRPCRequest(jsonrpc="2.0", id=4, method="tools/call", params={}))
    event = questions.cancelled("4")
    assert not event.is_set()
    told = {"requestId": 4}
    questions.came(
        ours.JSONRPCNotification(jsonrpc="2.0", method="notifications/cancelled", params=told)
    )
    assert event.is_set()
    assert questions.cancelled("4") is None
