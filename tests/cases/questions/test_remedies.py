"""Every remedy that `gfor new` and the readers of networks print works if it is typed: a gallery of broken files.

A remedy is an option of ``gfor new`` between backticks, and a key of the case, ``leave_out = ['gne'] in [network]``."""

import ast
import io
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import orchestrator
from orchestrator.cases.case import load_case
from orchestrator.cases.flow import limits
from orchestrator.core.errors import CosimError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_devices import GNE, MULTI, lines_of
from tests.cases.networks.psse.test_dyr import DYR
from tests.cases.networks.psse.test_dyr_converters import MACHINES as WITH_REGFM
from tests.cases.networks.psse.test_dyr_following import dyr as following
from tests.cases.networks.psse.test_references import DYR as ONE_MACHINE
from tests.cases.networks.psse.test_references import RAW as TWO_BUSES

FILES = Path(__file__).parents[3] / ".docs" / "tutorials" / "psse"
NINE = raw(33)
MPC = """\
function mpc = three
mpc.version = '2';
mpc.baseMVA = 100;
mpc.bus = [1 3 0 0 0 0 1 1.02 0 20 1 1.1 0.9; 2 1 50 10 0 0 1 1.0 -2 20 1 1.1 0.9; 3 2 0 0 0 0 1 1.01 -1 20 1 1.1 0.9];
mpc.gen = [1 20 0 99 -99 1.02 100 1 99 0; 3 30 0 99 -99 1.01 100 1 99 0];
mpc.branch = [1 2 0.01 0.1 0 0 0 0 0 0 1 -360 360; 2 3 0.01 0.1 0 0 0 0 0 0 1 -360 360];
"""


def nine(section, lines):
    """Text of the WSCC system with lines of a section."""
    found = records(33)
    found[section] = [*found[section], *lines]
    return raw(33, found)


@dataclass(frozen=True)
class Broken:
    """Files, the words of a command, what its message says beside the remedy, and what is told of after that.

    ``key``: a line of the case with the table where it goes, which leads to the message; ``undo``: what makes a case
    that was written with the remedy one without it (texts and what replaces them), besides leaving its keys out."""

    said: str
    raw: str = NINE
    dyr: str = ""
    words: str = ""
    then: str = ""
    key: tuple[str, str] = ("", "")
    undo: tuple[tuple[str, str], ...] = ()
    files: dict[str, str] = field(default_factory=dict)

    def write(self, folder: Path) -> list[str]:
        """Write the files; return the command that reads them."""
        files = self.files or {"grid.raw": self.raw} | ({"grid.dyr": self.dyr} if self.dyr else {})
        for name, text in files.items():
            (folder / name).write_text(text)
        return ["new", *(str(folder / name) for name in files), *shlex.split(self.words)]


TERMINALS = [line.replace("{met}", "") for line in MULTI]
FACTS = "'F 2',4,6,9,40.0,10.0,1.02,200.0,9999,0.9,1.1,1,0,0.05,100,1,0,0,0,0"
SEXS = "2 'SEXS' 1  0.1 10.0 100.0 0.05 -5.0 5.0 /\n"
GENCLS = "3 'GENCLS' 1  2.35 0.0 /"
GENROU = "3 'GENROU' 1 6.0 0.04 0.535 0.06 3.33 0.0 1.72 1.66 0.23 0.378 0.2 0.1 0.0 0.0 /"
UNITS = "bus,rating_mva,p_mw,v_pu,q_min_mvar,q_max_mvar\n1,900,790,1.02,-500,500\n"
TABLES = {
    "lines.csv": "from,to,R,X,B\n1,2,0,0.02,0\n2,3,0,0.03,0\n",
    "loads.csv": "bus,p_mw,q_mvar\n2,800,100\n",
    "units.csv": f"{UNITS}3,10,9,1.2,-5,5\n",
}
"""A machine of 10 MVA that is to hold 1.2 pu."""
EMT = (
    ('models = "phasor"', "#"),
    ('"synchronous_generator_phasor"', '"synchronous_generator"'),
    ('"gfor_phasor"', '"gfor"'),
    ('"phasor_grid"', '"grid"'),
)


def changed(text, *pairs):
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    return text


def lines(section, old="", new=""):
    """Records of a section, with a text changed."""
    own = TERMINALS if section == "MULTI-TERMINAL DC" else lines_of(section, 33)
    return nine(section, [changed(line, (old, new)) if old in line else line for line in own])


GALLERY = {
    "section": Broken(
        "to go on without them",
        changed(
            NINE,
            ("END OF GNE DATA, BEGIN", "END OF GNE DATA, BEGIN WAVE TRAP DATA\n5,1\n0 / BEGIN"),
        ),
    ),
    "GNE without terminals": Broken("no record of a GNE", nine("GNE", ["'G','OWN','x',8"])),
    "GNE of a user": Broken("and put what it feeds or draws into loads", nine("GNE", GNE)),
    "lines of a DC network": Broken(
        "or leave no DC network", lines("MULTI-TERMINAL DC", "'M 1',3", "'M 1',9")
    ),
    "bus between DC buses": Broken(
        "a converter between two DC buses", lines("MULTI-TERMINAL DC", "'A',0", "'A',2")
    ),
    "DC network": Broken(
        "and resistances; mend the record", lines("MULTI-TERMINAL DC", ",40.0,1,", ",-4000.0,1,")
    ),
    "FACTS mode": Broken("MODE is 9", nine("FACTS DEVICE", [FACTS])),
    "VSC": Broken("mend the record, or write", lines("VSC DC LINE", "-50.0", "50000")),
    "DC line": Broken("at its buses' voltages", lines("TWO-TERMINAL DC", "60.0,250", "6000,250")),
    "DC line at one bus": Broken(
        "its rectifier and its inverter at one bus", lines("TWO-TERMINAL DC", "8,1,22", "5,1,22")
    ),
    "motor": Broken("its circuit allows less", lines("INDUCTION MACHINE", ",15.0,", ",150.0,")),
    "no solution with devices": Broken(
        "let them go", lines("TWO-TERMINAL DC", "60.0,250.0", "900.0,2500.0")
    ),
    "how devices follow": Broken("How they follow the voltage is open", lines("INDUCTION MACHINE")),
    "no reference": Broken(
        "without which PSS/E solves nothing",
        changed(NINE, ("1,'BUS 1     ',16.5,3", "1,'BUS 1     ',16.5,2")),
    ),
    "no reference in MATPOWER": Broken(
        "that feeds what is left, such as",
        files={"three.m": changed(MPC, ("[1 3 0 0", "[1 2 0 0"))},
    ),
    "infinite bus": Broken(
        "an infinite bus holds",
        TWO_BUSES.format(far=3, near=2, bare=""),
        ONE_MACHINE,
    ),
    "no frequency": Broken(
        "if it is another, write it", changed(NINE, ("33,0,1,60.0", "33,0,1,0.0"))
    ),
    "no frequency in MATPOWER": Broken("; write it, such as", files={"three.m": MPC}),
    "limits": Broken(
        "to keep the limits, write",
        changed(NINE, ("2,'1 ',163.0,0,300,-300", "2,'1 ',163.0,0,2,-20")),
        DYR,
        then="limits of reactive power are reached",
    ),
    "too much reactive power": Broken("or keep its limits", files=TABLES),
    "load that cancels itself": Broken(
        "a load that cancels itself",
        changed(NINE, ("90,30,0,0,0,0", "90,30,-89.9,0,0,0")),
        undo=(('raw = "grid.raw"', 'raw = "grid.raw"\nkeep_load_parts = true'),),
    ),
    "open loads": Broken("the load model is open", NINE, DYR),
    "load's record": Broken(
        "to take it for all loads",
        NINE,
        DYR + "4 'IEELBL' 1 0.4 0.6 0 1 0 0 1.5 -1 0 2 0 1 0 0 /\n",
    ),
    "models": Broken("to go on without them", NINE, DYR + "1 'NOSTAB' 1 3 /\n1 'OEL1B' 1 3 /\n"),
    "machine itself": Broken(
        "it cannot be left out", NINE, DYR.replace("3 'GENCLS'", "3 'GENQEC1'")
    ),
    "machine without a record": Broken(
        "and a converter of ours stands there",
        NINE,
        changed(DYR, (GENCLS + "\n", "")),
        undo=(('replace = ["3"]', ""),),
    ),
    "machines without a record": Broken(
        "is a constant current (static generation)",
        NINE,
        re.sub(rf"(?m)^2,'GENROU'.*\n|^{GENCLS}\n", "", DYR),
        undo=(('replace = ["machine without record"]', ""),),
    ),
    "exciter of a classical machine": Broken(
        "a constant emf without a field winding", NINE, DYR + SEXS.replace("2 'SEXS'", "3 'SEXS'")
    ),
    "exciters of classical machines alone": Broken(
        "(and 1 more exciter)",
        NINE,
        re.sub(r"(?m)^[12].*GENROU.*\n(  .*\n)?", "1 'GENCLS' 1 3 0 /\n", DYR).replace(
            "1 'GENCLS' 1 3 0 /\n1", "1 'GENCLS' 1 3 0 /\n2"
        )
        + SEXS,
    ),
    "second machine of another model": Broken("remove one, or write", NINE, f"{DYR}{GENROU}\n"),
    "converter that is not known": Broken(
        "a grid-following converter", NINE, changed(DYR, (GENCLS, "3 'WT4G2' 1 0 /"))
    ),
    "converter that no approximation fits": Broken(
        "cannot be approximated", NINE, following(QFLAG=1, VFLAG=1), "--dyr-approximate"
    ),
    "plant": Broken(
        "the controller of a plant",
        NINE,
        following(plant="3 'REPCA1' 1 0 /\n"),
        "--dyr-approximate",
        then="REPCA1 left out, as dyr_leave_out says",
    ),
    "control at another bus": Broken("for the terminal", NINE, following(BUSR=2)),
    "turbine without its shaft": Broken(
        "and the shaft turns at rated speed", NINE, following(plant="3 'WTARA1' 1 0.007 0 /\n")
    ),
    "stabiliser alone": Broken(
        "at a machine without an exciter acts on nothing",
        NINE,
        DYR + "2 'STAB1' 1  1.0 10.0  2.5 0.02  0.5555556 5.4  0.1 /\n",
    ),
    "signal of another bus behind lags": Broken(
        "which no part of ours does",
        NINE,
        DYR + SEXS + "2 'IEEEST' 1 2 5 0 0 0 0 0 0 0.1 0.02 0.1 0.02 10 10 20 0.1 -0.1 0 0 /\n",
    ),
    "machine without an exciter": Broken(
        "or choose a part in [units]", NINE, changed(DYR, (GENCLS, GENROU)) + SEXS
    ),
    "choice of nothing": Broken(
        "has a record of it for every machine", NINE, DYR + SEXS, key=("units", "exciter = 'sexs'")
    ),
    "choice of no machine": Broken(
        "correct or remove the key", NINE, DYR, key=("units", "machine = 'gensal'")
    ),
    "converter in an EMT case": Broken(
        "phasor models go together", NINE, WITH_REGFM, "--models emt", undo=EMT
    ),
    "unusual value": Broken(
        "if it is meant, say so", NINE, changed(DYR, ("3.33,0.0, 1.72", "0.8,0.0, 1.72"))
    ),
    "parts of loads in MATPOWER": Broken(
        "keep_load_parts is for networks of PSS/E",
        files={"three.m": MPC},
        key=("network", "keep_load_parts = true"),
    ),
    "moving controls in MATPOWER": Broken(
        "move_controls is for networks of PSS/E",
        files={"three.m": MPC},
        key=("network", "move_controls = true"),
    ),
    "devices left out of MATPOWER": Broken(
        "leave_out is for networks of PSS/E",
        files={"three.m": MPC},
        key=("network", "leave_out = ['gne']"),
    ),
    "reference without a unit": Broken(
        "name a unit that is to feed it", NINE, DYR, key=("scenarios.base", "remove = ['sg1']")
    ),
}

_OPTION = re.compile(r"`gfor new ([^`]+)`")
_VALUE = r"""(\[[^\]]*\]|\{(?:[^{}]|\{[^{}]*\})*\}|"[^"]*"|'[^']*'|\w+)"""
_KEY = re.compile(rf"(\w+) = {_VALUE} in \[([\w.]+)\]")
_KEY_OF_TABLE = re.compile(rf"in \[(\w+)\], such as (\w+) = {_VALUE}")
_KEY_AT_TOP = re.compile(rf"at the top of the case: (\w+) = {_VALUE}")


def keys_in(message):
    """Keys of a case that a message tells, each as table, key and value."""
    for key, value, table in _KEY.findall(message):
        yield table, key, value
    yield from _KEY_OF_TABLE.findall(message)
    for key, value in _KEY_AT_TOP.findall(message):
        yield "", key, value


def without_key(text, table, key):
    """A case without a key of one of its tables."""
    head, found, rest = text.partition(f"[{table}]\n") if table else ("", "", text)
    body, bracket, tail = rest.partition("\n[")
    return head + found + re.sub(rf"(?m)^{key} = .*\n?", "", body) + bracket + tail


def with_key(text, table, key, value):
    """A case with a key in one of its tables, in the place of what stands there."""
    bare = without_key(text, table, key)
    line = f"{key} = {value}\n"
    if not table:
        return line + bare
    if f"[{table}]\n" not in bare:
        return f"{bare}\n[{table}]\n{line}"
    return bare.replace(f"[{table}]\n", f"[{table}]\n{line}", 1)


def answers(path):
    """The questions about a case, or the problems for which it is refused."""
    try:
        scenarios = load_case(path).prepare()
    except CosimError as error:
        return 2, str(error).splitlines()
    return 0, [str(question) for scenario in scenarios for question in scenario.questions]


def about(told, said):
    """Lines that hold a message; its remedies stand there."""
    return " ".join(line for line in told if said in line)


@pytest.mark.parametrize("name", GALLERY)
def test_a_remedy_works_as_it_is_typed(name, gfor, tmp_path):
    broken, case = GALLERY[name], tmp_path / "case.toml"
    command = [*broken.write(tmp_path), "--out", str(case)]

    def run(*more):
        code, _, err = gfor(*command, *more)
        return (code, err.splitlines()) if code else answers(case)

    def check(code, told):
        assert broken.said not in about(told, broken.said).replace(broken.then or "\0", ""), told
        assert code == 0, told
        assert broken.then in " ".join(told)

    _, told = run()
    if broken.key[0]:
        key, _, value = broken.key[1].partition(" = ")
        case.write_text(with_key(case.read_text(), broken.key[0], key, value))
        _, told = answers(case)
    message = about(told, broken.said)
    assert message, told
    options, keys = _OPTION.findall(message), [*keys_in(message)]
    if "remove the key" in message:
        case.write_text(without_key(case.read_text(), broken.key[0], key))
        check(*answers(case))
        return
    assert options or keys, message
    for option in () if broken.key[0] else options:
        typed = shlex.split(option)
        if typed[0] in broken.words:  # it takes one value
            command = [word for word in command if word not in shlex.split(broken.words)]
        check(*run(*typed, "--force"))
    text = case.read_text()
    if options and not broken.key[0]:  # what was written has the remedy
        for table, key, _ in () if broken.undo else keys:
            text = without_key(text, table, key)
        case.write_text(changed(text, *broken.undo))
        text = case.read_text()
        assert about(answers(case)[1], broken.said), (
            "without its keys the case is as the command was"
        )
    for chosen in [keys] if broken.undo else [[one] for one in keys]:
        for table, key, value in chosen:
            text = with_key(text, table, key, value)
        case.write_text(text)
        check(*answers(case))


# -- what the command itself asks for --------------------------------------------------------------

AT_NINE = "bus 9, 300 MVA, 200 MW"
AT_ONE = "--converter 'bus 1, 900 MVA, 700 MW, instead of sg1'"
OUT = "--out case.toml"
COMMANDS = {
    "file that is there": (f"{OUT}", "the file is there already", "(--force)", f"{OUT} {{}}"),
    "end of a name": ("--out case.txt", "a case file ends in", r"ends in (\.toml)", "--out case{}"),
    "binding of nothing": (
        f"--binding b.toml {OUT}",
        "are for a converter; say where by",
        "by (--converter '[^']*')",
        f"{{}} {OUT}",
    ),
    "binding of no FMU": (
        f"--binding b.toml --converter '{AT_NINE}' {OUT}",
        "give it with --fmu",
        "with (--fmu)",
        f"--binding b.toml --converter '{AT_NINE}' {OUT} {{}} b.fmu",
    ),
    "form of a vendor's file": (
        f"--models phasor --dll b.toml --converter '{AT_NINE}' {OUT}",
        "as EMT models do; leave out --models",
        "(leave out) --models",
        f"--dll b.toml --converter '{AT_NINE}' {OUT}",
    ),
    "models of a case": (
        f"{OUT} --models",
        "--models is 'emt' or 'phasor' for a case",
        "is '(emt)'",
        f"{OUT} --models {{}} --force",
    ),
    "rating that is missing": (
        f"--converter 'bus 9' {OUT}",
        "write it like 'bus 9",
        "like '([^']*)'",
        f"--converter '{{}}' {OUT} --force",
    ),
    "machine that feeds nothing": (
        f"--converter 'bus 9, 900 MVA, 719 MW, less sg3' {OUT} --force",
        "would feed nothing; write 'instead of",
        "write '([^']*)'",
        f"--converter 'bus 9, 900 MVA, 719 MW, {{}}' {OUT} --force",
    ),
    "more than a machine feeds": (
        f"--converter 'bus 9, 900 MVA, 800 MW, less sg3' {OUT} --force",
        "give the converter at most",
        "at most (.*? MW)",
        f"--converter 'bus 9, 900 MVA, {{}}, less sg3' {OUT} --force",
    ),
    "more than a machine feeds, from the slack": (
        f"--converter 'bus 9, 900 MVA, 800 MW, less sg3' {OUT} --force",
        "or leave the rest to the slack without 'less'",
        "(without 'less')",
        f"--converter 'bus 9, 900 MVA, 800 MW' {OUT} --force",
    ),
    "two in the place of one": (
        f"--converter '{AT_NINE}, instead of sg3' --converter 'bus 7, 300 MVA, 200 MW, less sg3' {OUT} --force",
        "and another converter names it too; write",
        "write '([^']*)' at both",
        f"--converter '{AT_NINE}, {{0}}' --converter 'bus 7, 300 MVA, 200 MW, {{0}}' {OUT} --force",
    ),
    "instead of the slack": (
        f"{AT_ONE} {OUT} --force",
        "it is at the slack; replace another, or name",
        "another slack by (--slack)",
        f"{AT_ONE} {{}} sg2 {OUT} --force",
    ),
    "nothing": ("", "write it like", "gfor new own.raw own.dyr (--converter .*)", "{}"),
}
"""Words, what is said, its remedy, and the words with that; those of one command need no file for the next."""

NEXT = {
    "binding of no FMU": "b.fmu",
    "form of a vendor's file": "b.toml",
    "more than a machine feeds": "would feed nothing; write 'instead of sg3'",
    "more than a machine feeds, from the slack": "sg1 cannot start",
}
"""What is told of next: an empty file of a vendor, and a power that the machines cannot do without."""


@pytest.mark.parametrize("name", COMMANDS)
def test_what_the_command_asks_for_works_as_it_is_typed(name, gfor, tmp_path, monkeypatch):
    words, said, remedy, typed = COMMANDS[name]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    for suffix in ("raw", "dyr"):
        (tmp_path / f"own.{suffix}").write_text((FILES / f"areas.{suffix}").read_text())
    for file in ("b.toml", "b.fmu"):
        if name in ("binding of no FMU", "form of a vendor's file"):
            (tmp_path / file).touch()
    if name == "file that is there":
        (tmp_path / "case.toml").touch()
    network = ["own.raw", "own.dyr"]
    code, _, err = gfor("new", *(network if words else ()), *shlex.split(words))
    assert code == 2
    assert said in " ".join(err.split())
    found = re.search(remedy, err)
    assert found, err
    code, _, err = gfor("new", *network, *shlex.split(typed.format(*found.groups())))
    assert said not in err
    assert (code == 0) is (name not in NEXT), err
    assert NEXT.get(name, "") in err


# -- no remedy without an example ------------------------------------------------------------------

_ROOT = Path(orchestrator.__file__).parent
_CASES = _ROOT / "cases"
_READERS = (
    *(_CASES / "networks").rglob("*.py"),
    *(_CASES / "new").glob("*.py"),
    _CASES / "questions" / "plausibility.py",
    _CASES / "questions" / "plausible_loads.py",
    _CASES / "questions" / "plausible_sources.py",
    _CASES / "flow" / "limits.py",
    _CASES / "scenario" / "operating_point.py",
    _CASES / "scenario" / "start_values.py",
    _CASES / "scenario" / "unit_tables.py",
    _ROOT / "face" / "cli" / "new.py",
)
_KEYS = (
    "leave_out|dyr_leave_out|dyr_approximate|replace|keep_load_parts|load_model|device_model|slack|frequency|"
    "reactive_limits|exciter|governor|stabilizer|machine|generator|meant"
)
_HELPERS = "without_kinds|without_models|replacement_of|with_slack|with_frequency"
_HELPERS += "|KEEPING_LIMITS|APPROXIMATING|WITHOUT_PARTS"
_REMEDY = re.compile(
    rf"`gfor new|\b(?:{_HELPERS})\b|(?:write|say|choose|such as|top of the case:)[^;]* (?:{_KEYS}) = "
    r"|\b(?:write|give|name|leave|say|by|choose|or)\b[^;]*--[a-z]+|write '|write it like|ends in \.toml"
    r"|remove (?:the key|keep)|without '|--models is"
)
_ELSEWHERE = (
    "`gfor fmu bind` drafts one",  # tests/devices/binding/test_draft.py
    "give that to --dll",  # tests/vendor_dll
    "reactive_limits = false in [power_flow]",  # in the next test
    "write --models phasor, or leave it out",  # tests/cases/new/test_moved_controls.py
    "of a RAW file, and the network is",  # as above
    "a system of its own, with a reference of its own",  # tests/cases/networks/psse/test_studied_parts.py
    "without which PSS/E refuses the file",  # as above
    "what the control does to a mode",  # tests/cases/networks/psse/test_dc_line_models.py
    "of whose fields no public source has the order",  # tests/cases/networks/psse/test_dyr_converters.py
    "moves the power reference of the governor",  # tests/cases/networks/psse/test_load_controllers.py
    "correct the record, or write",  # tests/cases/networks/psse/test_composite_loads.py
    "study each on its own",  # tests/cases/networks/cgmes/test_cgmes.py, by the same function
)
"""Remedies that other tests type, or that no small network asks for."""


def test_limits_that_do_not_settle_are_not_kept_as_the_message_says(gfor, tmp_path, monkeypatch):
    """A power flow that goes from limit to limit needs many buses: here one round is too many."""
    file, case = tmp_path / "grid.raw", tmp_path / "case.toml"
    file.write_text(changed(NINE, ("163.0,0,300,-300", "163.0,0,5,-5")))
    monkeypatch.setattr(limits, "_ROUNDS", 1)
    code, _, err = gfor("new", str(file), "--reactive-limits", "--out", str(case))
    assert code == 2
    assert "'bus_2'; widen their limits, or write reactive_limits = false in [power_flow]" in err
    assert not gfor("new", str(file), "--out", str(case))[0]
    case.write_text(with_key(case.read_text(), "power_flow", "reactive_limits", "false"))
    code, told = answers(case)
    assert code == 0
    assert "limits of reactive power" not in " ".join(told)


def texts_of(path):
    """Texts in a module, with what stands in braces in its code; no documentation."""
    nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    bodies = [
        node.body for node in nodes if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
    ]
    left = {id(one.value) for body in bodies for one in body if isinstance(one, ast.Expr)}
    for joined in (node for node in nodes if isinstance(node, ast.JoinedStr)):
        left |= {id(part) for part in joined.values}
        yield "".join(_text_of(part) for part in joined.values)
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in left:
            yield node.value


def _text_of(part):
    return str(part.value) if isinstance(part, ast.Constant) else f"{{{ast.unparse(part.value)}}}"


def test_every_remedy_that_the_readers_print_has_an_example():
    said = [broken.said for broken in GALLERY.values()]
    said += [one for _, one, _, _ in COMMANDS.values()]
    found = [text for path in _READERS for text in texts_of(path) if _REMEDY.search(text)]
    assert len(found) > 40
    without = [text for text in found if not any(one in text for one in (*said, *_ELSEWHERE))]
    assert without == []
