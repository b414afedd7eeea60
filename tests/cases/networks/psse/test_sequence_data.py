"""Sequence data of PSS/E: the impedances of the WSCC system by hand, and what a file of another case is told."""

import json

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.core.errors import CaseError, InputError
from orchestrator.face.cli import main
from tests.cases.networks.psse import LINES, LOADS, REACTANCES, TRANSFORMERS, raw, records

pytestmark = pytest.mark.usefixtures("undrawn")

DYR = "\n".join(f"{n} 'GENCLS' 1 {h} 0.0 /" for n, h in ((1, 9.55), (2, 3.33), (3, 2.35)))
BASES = {1: 247.5, 2: 192.0, 3: 128.0}
X2 = {1: 0.13, 2: 0.22, 3: 0.21}
CASE = """\
name = "wscc"
models = "phasor"
[solver]
step_size = "1 ms"
stop_time = "2 s"
[power_flow]
grid = "grid"
[components.grid]
model = "grid"
[network]
raw = "grid.raw"
{seq}
[units]
dyr = "grid.dyr"
generator = "synchronous_generator"
converter = "gfor"
generator_parameters = {{ transformer.X_t = 0.0, transformer.R_t = 0.0 }}
[[events]]
type = "bus_fault"
time = "1 s"
{fault}
duration = "100 ms"
"""
NO_LOADS = [f"{n},'1 ',0,0,0,0,0" for n in LOADS]
PATH_AT_9 = (0.02, 0.3)
"""R and X of the neutral of machine 3's transformer [pu, 100 MVA]."""


def zero_of(line):
    """Zero-sequence impedance and charging that the tests' files give a line."""
    *_, r, x, b = line
    return 4 * r + 2.5j * x, 0.6 * b


def transformers(coded):
    """Records of the transformers: two YNd with the network's side first, one with an impedance at its neutral."""
    found = []
    for i, j, x in TRANSFORMERS:
        r_g, x_g = PATH_AT_9 if j == 3 else (0.0, 0.0)
        z = f"0.0,{0.9 * x}"
        if coded:
            found.append(f"{i},{j},0,'1 ',1,1,12,{r_g},{x_g},{z},0,0,0,0,0,0")
        else:
            found.append(f"{i},{j},0,'1 ',2,{r_g},{x_g},{z},0,0")
    return found


def branches(lines=LINES):
    found = []
    for line in lines:
        z, b = zero_of(line)
        found.append(f"{line[0]},{line[1]},'1 ',{z.real},{z.imag},{b},0,0,0,0")
    return found


def seq(machines=None, lines=LINES, of_transformers=None, mutual=(), revision=33):
    """Text of a file with one section for the machines."""
    machines = machines or [
        f"{n},'1 ',0,{REACTANCES[n]},0.3,1.0,0,{X2[n]},0,0.05,1,0,0,0" for n in X2
    ]
    parts = [
        ("GENERATOR", machines),
        ("LOAD", NO_LOADS),
        ("ZERO SEQ. NON-TRANSFORMER BRANCH", branches(lines)),
        ("ZERO SEQ. MUTUAL", mutual),
        (
            "ZERO SEQ. TRANSFORMER",
            transformers(True) if of_transformers is None else of_transformers,
        ),
        ("ZERO SEQ. SWITCHED SHUNT", ()),
        ("ZERO SEQ. FIXED SHUNT", ()),
    ]
    text = [f"0,{revision} / SEQ"]
    if revision > 34:
        text += ["RPTFORMAT, AMPOUT=0", "0 / END OF SYSTEM-WIDE DATA, BEGIN GENERATOR DATA"]
    following = [name for name, _ in parts[1:]] + [""]
    for (name, rows), after in zip(parts, following, strict=True):
        text += [*rows, f"0 / END OF {name} DATA" + (f", BEGIN {after} DATA" if after else "")]
    return "\n".join([*text, "Q", ""])


def old_seq():
    """The same in revision 30: each sequence of the machines is a section, and nothing is coded."""
    machines = [
        [f"{n},'1 ',0,{data[n]}" for n in X2] for data in (REACTANCES, X2, dict.fromkeys(X2, 0.05))
    ]
    sections = [*machines, [], [], branches(), [], transformers(False), [], []]
    return "\n".join(["0,30 / SEQ", *(x for rows in sections for x in [*rows, "0 /"]), ""])


@pytest.fixture
def prepared(tmp_path):
    def prepare(text=None, fault='bus = "bus_5"\nkind = "1-phase"', more=""):
        (tmp_path / "grid.raw").write_text(raw())
        (tmp_path / "grid.dyr").write_text(DYR)
        if text is not None:
            (tmp_path / "grid.seq").write_text(text)
        key = "" if text is None else 'seq = "grid.seq"'
        case = CASE.format(seq=f"{key}\n{more}", fault=fault)
        (tmp_path / "case.toml").write_text(case)
        return load_case(tmp_path / "case.toml").prepare()[0]

    return prepare


def by_hand(flow, bus, coupled=0.0):
    """Z2 and Z0 at a bus, from dense matrices."""
    Y = np.zeros((2, 9, 9), dtype=complex)

    def series(k, i, j, y):
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            Y[k, a - 1, b - 1] += sign * y

    for line in LINES:
        i, j, r, x, b = line
        z, b_0 = zero_of(line)
        series(0, i, j, 1 / complex(r, x))
        series(1, i, j, 1 / z)
        for k, charging in ((0, b), (1, b_0)):
            for end in (i, j):
                Y[k, end - 1, end - 1] += 0.5j * charging
    for i, j, x in TRANSFORMERS:
        series(0, i, j, 1 / (1j * x))
        earthing = 3 * complex(*PATH_AT_9) if j == 3 else 0
        Y[1, i - 1, i - 1] += 1 / (0.9j * x + earthing)
    for n, x in X2.items():
        Y[0, n - 1, n - 1] += BASES[n] / 100 / (1j * x)
        Y[1, n - 1, n - 1] += BASES[n] / 100 / 0.05j
    for n, (p, q) in LOADS.items():
        Y[0, n - 1, n - 1] += complex(p, -q) / 100 / abs(flow.voltages[f"bus_{n}"]) ** 2
    if coupled:
        pair = [line for line in LINES if line[:2] in ((4, 5), (4, 6))]
        own = np.diag([zero_of(line)[0] for line in pair])
        change = np.linalg.inv(own + coupled * (1 - np.eye(2))) - np.linalg.inv(own)
        incidence = np.zeros((2, 9))
        for k, line in enumerate(pair):
            incidence[k, line[0] - 1], incidence[k, line[1] - 1] = 1, -1
        Y[1] += incidence.T @ change @ incidence
    return [np.linalg.inv(Y[k])[bus - 1, bus - 1] for k in range(2)]


@pytest.mark.parametrize("text", [seq(), seq(revision=35), old_seq()], ids=["33", "35", "30"])
def test_the_impedances_are_those_by_hand(text, prepared):
    ready = prepared(text)
    (found,) = ready.faults
    negative, zero = by_hand(ready.power_flow, 5)
    assert found.negative == pytest.approx(negative, rel=1e-9)
    assert found.zero == pytest.approx(zero, rel=1e-9)
    assert found.seen == pytest.approx(negative + zero, rel=1e-9)
    assert "grid.seq" in found.source
    assert not [q for q in ready.questions if "[network.sequences]" in str(q)]
    unused = [x.kind for x in ready.records if "sequence" in x.kind and x.use == "not used"]
    assert set(unused) <= {"positive machine (sequence data)"}


def test_mutual_impedances_count(prepared):
    mutual = ["4,5,'1 ',6,4,'1 ',0.0,-0.1,0,1,0,1"]  # the second line the other way round
    ready = prepared(seq(mutual=mutual))
    _, zero = by_hand(ready.power_flow, 5, coupled=0.1j)
    assert ready.faults[0].zero == pytest.approx(zero, rel=1e-9)
    assert zero != pytest.approx(by_hand(ready.power_flow, 5)[1], rel=1e-3)


def told(ready, words):
    return [str(q) for q in ready.questions if words in str(q)]


def test_a_file_of_another_case_is_asked_about(prepared):
    foreign = [f"{n + 100},'1 ',0,0.2,0.3,1.0,0,0.2,0,0.05,1,0,0,0" for n in X2]
    ready = prepared(seq(machines=foreign))
    (text,) = told(ready, "is the file of another case?")
    assert "3 records of sequence data are of buses that the network's file lacks" in text
    assert "line 2 bus 101" in text
    assert told(ready, "X2 is taken as 1 times X''d (3 elements")
    unused = [x for x in ready.records if "no bus 101" in x.why]
    assert [x.kind for x in unused] == ["machine (sequence data)"]


def test_a_line_without_data_is_asked_about(prepared):
    ready = prepared(seq(lines=LINES[1:]))
    (text,) = told(ready, "3 times that of the positive sequence")
    assert "(1 element: line_4_5)" in text


def test_exchanged_sides_of_transformers_change_the_impedance_and_are_asked_about(prepared):
    turned = [x.replace(",12,", ",13,") for x in transformers(True)]
    ready = prepared(seq(of_transformers=turned))
    assert ready.faults[0].zero.imag < 0  # only charging is left
    text = " ".join(told(ready, "are its sides exchanged?"))
    assert "line_4_1" in text


def test_an_order_of_buses_that_is_another_is_asked_about(prepared):
    rows = [f"{j},{i},0,'1 ',1,1,13,0,0,0.0,{0.9 * x},0,0,0,0,0,0" for i, j, x in TRANSFORMERS]
    ready = prepared(seq(of_transformers=rows))
    assert len(told(ready, "stand in another order than in the network's file")) == 3


def test_a_base_that_is_another_is_asked_about(prepared):
    lines = [(i, j, 100 * r, 100 * x, b) for i, j, r, x, b in LINES]
    assert told(prepared(seq(lines=lines)), "Z0 by Z1 of lines is 25")
    machines = [f"{n},'1 ',0,{REACTANCES[n]},0.3,1.0,0,{X2[n] / 10},0,0.05,1,0,0,0" for n in X2]
    (text,) = told(prepared(seq(machines=machines)), "X2 by X'' of machines (ZX of RAW) is 0.1")
    assert "on the machines' bases, MBASE?" in text


def test_no_path_to_earth_means_no_current_and_is_told(prepared):
    ready = prepared(fault='bus = "bus_2"\nkind = "1-phase"')  # behind the delta of its transformer
    (found,) = ready.faults
    assert found.zero is None
    assert found.seen is None
    assert ready.events[0].settings() == {"bus_2.fault.on": False}
    (text,) = told(ready, "no path of the zero sequence leads to earth from bus_2")
    assert "draws no current there" in text
    assert "Z0 = no path" in found.in_words
    assert found.in_words.endswith("meets an open circuit: no current flows there")


@pytest.mark.parametrize(
    "fault",
    [
        'bus = "bus_5"\nkind = "1-phase"',
        'bus = "bus_5"\nkind = "2-phase-earth"',
        'bus = "bus_5"\nduration = "10 ms"\n[[events]]\ntype = "line_fault"\ntime = "1.5 s"\n'
        'line = "line_4_5"\nat = 0.3\nkind = "1-phase"',
    ],
    ids=["1-phase", "2-phase-earth", "along a line"],
)
def test_a_path_to_earth_of_capacitances_alone_is_told_with_what_earths_it(fault, prepared):
    words = "only capacitances (charging of lines, capacitors) lead the zero sequence to earth from"
    not_earthed = '[network.sequences]\nstep_up = "Yd"'
    ready = prepared(fault=fault, more=not_earthed)
    assert ready.faults[0].zero.imag < 0
    (text,) = told(ready, words)
    assert 'such as [network.sequences] step_up = "YNd"' in text
    assert "or give a SEQ file" in text
    assert not told(prepared(fault=fault, more=not_earthed.replace("Yd", "YNd")), words)


def test_capacitances_alone_do_not_matter_between_two_phases_and_a_file_is_named(prepared):
    words = "only capacitances"
    turned = [x.replace(",12,", ",13,") for x in transformers(True)]
    text = seq(of_transformers=turned)
    assert not told(prepared(text, fault='bus = "bus_5"\nkind = "2-phase"'), words)
    (asked,) = told(prepared(text), words)
    assert "or correct " in asked
    assert asked.endswith("grid.seq")


def test_a_machine_whose_neutral_is_to_earth_ends_the_question_of_capacitances(prepared):
    through = '[network.sequences]\nstep_up = "YNyn"'
    (asked,) = told(prepared(more=through), "only capacitances")
    assert "such as [network.sequences] machine_x0 = 0.1" in asked
    assert not told(prepared(more=f"{through}\nmachine_x0 = 0.1"), "only capacitances")


def seq_with(change, text=None):
    old, new = change
    text = seq() if text is None else text
    assert text.count(old) == 1
    return text.replace(old, new)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("7,8,'1 ',0.034,0.18,", "7,8,'1 ',0.034,-0.18,"),
            "has XLINZ = -0.18 pu, where X1 is 0.072: used as it stands; is its sign wrong?",
        ),
        (
            ("7,8,'1 ',0.034,0.18,", "7,8,'1 ',-0.034,0.18,"),
            "has RLINZ = -0.034 pu, where R1 is 0.0085: used as it stands",
        ),
        (
            ("7,8,'1 ',0.034,0.18,", "7,8,'1 ',0.034,0.018,"),
            "is 0.531, where 0.8 to 8 are usual (RLINZ + jXLINZ = 0.034+0.018j pu, R1 + jX1 = 0.0085+0.072j pu)",
        ),
        (("7,8,'1 ',0.034,0.18,", "7,8,'1 ',0.034,1.8,"), "is 24.8, where 0.8 to 8 are usual"),
    ],
)
def test_one_lines_unusual_impedance_is_asked_about_at_its_record(change, words, prepared):
    text = seq_with(change)
    ready = prepared(text)
    (asked,) = told(ready, words)
    number = next(k for k, line in enumerate(text.splitlines(), 1) if line.startswith(change[1]))
    assert f"line {number}:" in asked
    assert "line_7_8" in asked
    usual = prepared(seq())
    assert ready.faults[0].zero != usual.faults[0].zero  # what is asked about is used
    assert not told(usual, "are usual")
    assert not told(usual, "sign wrong")


def signed(field, sign=-1):
    """The file with the sign of one value of machine 3's transformer turned, and that record's line."""
    lines = seq().splitlines()
    at = next(k for k, line in enumerate(lines) if ",3,0,'1 ',1,1,12," in line)
    values = lines[at].split(",")
    values[field] = str(sign * float(values[field]))
    lines[at] = ",".join(values)
    return "\n".join([*lines, ""]), at + 1


X_G, X_01 = 8, 10
"""Columns of a two-winding transformer's record."""


@pytest.mark.parametrize(("field", "said"), [(X_01, "X0 = -"), (X_G, "XG = -")])
def test_a_turned_sign_of_a_transformers_zero_sequence_is_asked_about(field, said, prepared):
    text, line = signed(field)
    (asked,) = told(prepared(text), "(on 100 MVA): used as it stands; is its sign wrong?")
    assert f"line {line}:" in asked
    assert said in asked
    assert not told(prepared(signed(field, 1)[0]), "sign wrong?")


@pytest.mark.parametrize("count", [1, 3])
def test_each_negative_impedance_of_a_machine_is_asked_about_by_name(count, prepared):
    """However many of the machines have one: no median hides it, and no base is asked about."""
    signs = {n: -1 if n > 3 - count else 1 for n in X2}
    rows = [f"{n},'1 ',0,0.2,0.3,1.0,0,{signs[n] * X2[n]},0,0.05,1,0,0,0" for n in X2]
    ready = prepared(seq(machines=rows))
    found = told(ready, "sign wrong?")
    assert len(found) == count
    assert any("line 4: sg3 has X2 = -0.21 pu (ZXNEGDV)" in x for x in found)
    assert not told(ready, "in the middle of all")


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0,0.2,0.3,1.0,-0.01,0.21,0,0.05,1,0,0,0", "sg3 has R2 = -0.01 pu (ZRNEG)"),
        ("0,0.2,0.3,1.0,0,0.21,0,-0.05,1,0,0,0", "sg3 has X0 = -0.05 pu (ZX0DV)"),
        ("0,0.2,0.3,1.0,0,0.21,0,0.05,1,-2,0,0", "sg3 has RG = -2 pu (ZRG)"),
        ("0,0.2,0.3,1.0,0,0.9,0,0.05,1,0,0,0", "X2 by X'' of sg3 is 4.5, where 0.4 to 2.5"),
    ],
)
def test_a_machines_unusual_value_is_asked_about(row, words, prepared):
    rows = [f"{n},'1 ',0,0.2,0.3,1.0,0,{X2[n]},0,0.05,1,0,0,0" for n in (1, 2)]
    assert len(told(prepared(seq(machines=[*rows, f"3,'1 ',{row}"])), words)) == 1


def test_a_negative_x2_of_an_old_file_is_asked_about(prepared):
    text = seq_with(("\n3,'1 ',0,0.21\n", "\n3,'1 ',0,-0.21\n"), old_seq())
    assert len(told(prepared(text), "sg3 has X2 = -0.21 pu (ZX)")) == 1


def test_two_phases_to_earth_without_a_path_are_two_phases_and_it_is_told(prepared):
    ready = prepared(fault='bus = "bus_2"\nkind = "2-phase-earth"')
    (found,) = ready.faults
    assert found.seen == found.negative
    (text,) = told(ready, "no path of the zero sequence leads to earth from bus_2")
    assert "a fault of kind 2-phase-earth is one of kind 2-phase there" in text
    assert "the positive sequence meets Z2 alone" in text
    assert "[network.sequences] step_up" in text
    assert found.in_words.endswith("pu on 100 MVA, as at two phases without earth")
    with_path = prepared(fault='bus = "bus_5"\nkind = "2-phase-earth"')
    assert not told(with_path, "no path of the zero sequence")
    assert with_path.faults[0].in_words.endswith("pu on 100 MVA")
    assert not told(prepared(fault='bus = "bus_2"\nkind = "2-phase"'), "no path of the zero")


def test_ratios_of_the_case_are_no_questions(prepared):
    more = (
        "[network.sequences]\nline_z0 = 3.0\nline_b0 = 0.6\nstep_up = 'YNd'\nmachine_x2 = 1.0\n"
        "machine_x0 = 0.05\n"
    )
    asked = prepared()
    # the machines stand behind deltas, where their own neutrals do not count
    assert len(told(asked, "[network.sequences]")) == 3
    at_machine = prepared(fault='bus = "bus_2"\nkind = "1-phase"')
    assert told(at_machine, "the neutral is taken as not earthed (1 element: sg2)")
    stated = prepared(more=more)
    assert not told(stated, "[network.sequences]")
    assert stated.faults[0].negative == pytest.approx(asked.faults[0].negative)
    assert stated.faults[0].source == "ratios of the case and defaults"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "it is empty"),
        ("7,33\n", "IC is 7: sequence data begin with IC and REV"),
        ("0,33\n0 / END OF X DATA, BEGIN BUS DATA\n", "'BUS' is no section of sequence data"),
        (seq().replace("0.13", "x", 1), "ZXNEGDV is 'x'; it must be a number"),
    ],
)
def test_what_is_no_sequence_data_is_refused_by_line(text, words, prepared):
    with pytest.raises(CaseError, match=words):
        prepared(text)


def test_gfor_new_takes_the_file_and_refuses_it_alone(tmp_path):
    files = {"own.raw": raw(), "own.dyr": DYR, "own.seq": seq()}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    paths = [tmp_path / name for name in files]
    made = write_case(WantedCase((*paths,), tmp_path / "own.toml"))
    assert 'seq = "own.seq"' in made.text
    assert [x.line for x in made.records if "branch (sequence data)" in x.kind] == [*range(10, 16)]
    (tmp_path / "own.m").write_text("")
    for beside, words in (
        ((), "no network is given"),
        ((tmp_path / "own.m",), "need the network's RAW"),
    ):
        with pytest.raises(InputError, match=words):
            write_case(WantedCase((paths[2], *beside), tmp_path / "other.toml"))


def test_a_run_tells_the_kind_the_impedances_and_their_source(tmp_path, capsys):
    for name, text in {"grid.raw": raw(), "grid.dyr": DYR, "grid.seq": seq()}.items():
        (tmp_path / name).write_text(text)
    case = CASE.format(seq='seq = "grid.seq"', fault='bus = "bus_5"')
    (tmp_path / "case.toml").write_text(case)
    fault = "line_4_5 at 30 %, 50 ms, 1-phase, opens one pole, recloses after 100 ms"
    words = ["run", str(tmp_path / "case.toml"), "--stop", "1.3", "--json", "--fault", fault]
    main([*words, "--out", str(tmp_path / "out")])
    out, err = capsys.readouterr()
    (scenario,) = json.loads(out)
    told = scenario["sequences"]
    assert [(x["kind"], x["time"]) for x in told] == [("1-phase", 1.0), ("open pole", 1.05)]
    assert scenario["line_faults"] == ["line_4_5"]
    assert told[0]["words"].startswith("1-phase at line_4_5, 30 %, t = 1 s: Z2 = ")
    assert "of " in told[0]["source"]
    page = tmp_path / "page.html"
    main(["report", str(tmp_path / "out"), "--out", str(page)])
    assert "1-phase at line_4_5, 30 %" in page.read_text()
    assert "Traceback" not in err


def test_three_windings_have_their_delta_as_a_way_to_earth(tmp_path):
    """YNynd: both stars in series through the star point, which the delta's leg leads to earth."""
    of_windings = 0.03, 0.035, 0.08
    rows, rates = records(33), "0,0,0"
    rows["BUS"].append("10,'BUS 10    ',13.8,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9")
    rows["LOAD"].append("10,'1 ',1,1,1,5,1,0,0,0,0,1,1,0")
    first = next(k for k, x in enumerate(rows["TRANSFORMER"]) if x.startswith("7,2"))
    winding = f"1.0,0,0,{rates},0,0,1.1,0.9,1.1,0.9,33,0,0,0,0"
    rows["TRANSFORMER"][first : first + 4] = [
        "7,2,10,'1 ',1,1,1,0,0,2,'T 2',1,1,1",
        "0,0.0625,100,0,0.1,100,0,0.12,100,1.0,0.0",
        *[winding] * 3,
    ]
    coded = transformers(True)
    parts = ",".join(f"0,0,0,{x}" for x in of_windings)
    coded[1] = f"7,2,10,'1 ',1,1,12,{parts},0,0"
    files = {"raw": raw(33, rows), "dyr": DYR, "seq": seq(of_transformers=coded)}
    for suffix, text in files.items():
        (tmp_path / f"grid.{suffix}").write_text(text)
    case = CASE.format(seq='seq = "grid.seq"', fault='bus = "bus_7"\nkind = "1-phase"')
    (tmp_path / "case.toml").write_text(case)
    (found,) = load_case(tmp_path / "case.toml").prepare()[0].faults

    Y = np.zeros((11, 11), dtype=complex)  # the last is the star point

    def series(i, j, z):
        incidence = np.zeros(11)
        incidence[i - 1], incidence[j - 1] = 1, -1
        Y[:] += np.outer(incidence, incidence) / z

    for line in LINES:
        z, b = zero_of(line)
        series(*line[:2], z)
        for end in line[:2]:
            Y[end - 1, end - 1] += 0.5j * b
    for bus, z in ((4, 0.9j * 0.0576), (9, 0.9j * 0.0586 + 3 * complex(*PATH_AT_9))):
        Y[bus - 1, bus - 1] += 1 / z
    for n in X2:
        Y[n - 1, n - 1] += BASES[n] / 100 / 0.05j
    for bus, x in zip((7, 2), of_windings[:2], strict=True):
        series(bus, 11, 1j * x)
    Y[10, 10] += 1 / (1j * of_windings[2])
    Y[9, 9] += 1  # behind the delta nothing counts
    assert found.zero == pytest.approx(np.linalg.inv(Y)[6, 6], rel=1e-9)
