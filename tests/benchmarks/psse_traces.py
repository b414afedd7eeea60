"""Our machines and controls beside PSS/E's recordings in test/benchmarks/psse of PowerSimulationsDynamics.jl.

    python -m tests.benchmarks.psse_traces FOLDER

Reads each set's DYR as it lies there, runs its one machine beside the infinite bus (`tests.models.one_machine`), and
prints the deviation in percent of the swing, beside what that package's own tests allow for its own result. The last
column says whether `gfor new` takes the set's files as they are. What is not compared is listed with its reason."""

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.core.errors import CaseError, InputError
from tests.models.one_machine import OneMachine, four_buses, three_buses
from tests.models.test_psse_traces import E_fd, delta, deviation, v_2

UNTIL, EVERY = 20.0, 0.02  # length of most recordings, and what is compared of them [s]


@dataclass(frozen=True)
class Set:
    """A recording: files in its folder, column of the signal, and deviation that the source's tests allow (nan: none).

    ``four``: at the network of four buses; ``instead``: records that stand for those of a name, as the source's test
    has them."""

    folder: str
    dyr: str
    csv: str
    column: int
    signal: Callable
    allowed: float
    raw: str = "ThreeBusMulti.raw"
    four: bool = False
    instead: tuple[str, str] = ("", "")


_WIDE, _NARROW = (float(np.degrees(angle)) for angle in (0.1, 0.01))  # allowed for angles [degrees]
_ESST1A = (
    "EXST1",
    "2 ESST1A 1 1 1 0.01 5 -5 14.142135623731 20 14.142135623731 20 200 0.1 6.3 2.1 6 0 0.5 0.01 0.01 0.01 2.8 /",
)
SETS = (
    Set("GENROU", "ThreeBus_GENROU.dyr", "TEST_GENROU.csv", 1, delta, _WIDE),
    Set("GENROU", "ThreeBus_GENROU_HIGH_SAT.dyr", "TEST_GENROU_HIGH_SAT.csv", 1, delta, _WIDE),
    Set("GENROU", "ThreeBus_GENROU_NO_SAT.dyr", "TEST_GENROU_NO_SAT.csv", 1, delta, _WIDE),
    Set("GENROE", "ThreeBus_GENROE.dyr", "TEST_GENROE.csv", 1, delta, _WIDE),
    Set("GENROE", "ThreeBus_GENROE_HIGH_SAT.dyr", "TEST_GENROE_HIGH_SAT.csv", 1, delta, _WIDE),
    Set("GENSAL", "ThreeBus_GENSAL.dyr", "TEST_GENSAL.csv", 1, delta, _WIDE),
    Set("GENSAE", "ThreeBus_GENSAE.dyr", "TEST_GENSAE.csv", 1, delta, _WIDE),
    Set("AC1A", "ThreeBus_ESAC1A.dyr", "TEST_ESAC1A.csv", 1, delta, _NARROW),
    Set("AC1A", "ThreeBus_ESAC1A_SAT.dyr", "TEST_ESAC1A_SAT.csv", 1, delta, _NARROW),
    Set("SEXS", "ThreeBus_SEXS.dyr", "SEXS_RESULTS.csv", 6, E_fd, 1e-2),
    Set("SEXS", "ThreeBus_SEXS_noTE.dyr", "SEXS_RESULTS_NoTE.csv", 6, E_fd, 1e-2),
    Set("IEEEST", "ThreeBus_IEEEST.dyr", "IEEEST_SEXS_RESULTS_NOFILT.csv", 1, E_fd, 1e-2),
    Set("IEEEST", "ThreeBus_IEEEST_with_filter.dyr", "IEEEST_SEXS_RESULTS_FILT.csv", 1, E_fd, 1e-2),
    Set("GAST", "ThreeBus_GAST.dyr", "GAST_TEST.csv", 1, delta, _NARROW),
    Set("HYGOV", "ThreeBus_HYGOV.dyr", "HYGOV_RESULTS.csv", 2, delta, _NARROW),
    Set("TGOV1", "ThreeBus_TGOV1.dyr", "TEST_TGOV1.csv", 1, delta, _NARROW),
    Set(
        "ESST1A",
        "TVC_System.dyr",
        "results_PSSe.csv",
        1,
        v_2,
        1e-3,
        "TVC_System_32.raw",
        True,
        _ESST1A,
    ),
    Set(
        "ESST1A",
        "TVC_System.dyr",
        "results_PSSe.csv",
        4,
        E_fd,
        5e-2,
        "TVC_System_32.raw",
        True,
        _ESST1A,
    ),
    Set("EXST1", "TVC_System.dyr", "results_PSSe.csv", 2, v_2, 1e-3, "TVC_System_32.raw", True),
    Set("EXST1", "TVC_System.dyr", "results_PSSe.csv", 6, E_fd, np.nan, "TVC_System_32.raw", True),
    Set("EXAC1", "TVC_System.dyr", "results_PSSe.csv", 2, v_2, 1e-3, "TVC_System_32.raw", True),
)

UNREACHED = {
    "CSVGN1": "a static var system, no machine: tests.models.test_static_var",
    "DEGOV": "the recordings are PowerWorld's, not PSS/E's",
    "DERA": "distributed generation, no machine: tests.models.test_distributed_generation",
    "GAST (14 buses)": "several machines, by `gfor new` and `gfor run`: page of conventions",
    "LOAD": "loads of constant power and current, by `gfor run`: page of conventions",
    "MultiGen": "several machines and converters, by `gfor new` and `gfor run`: page of conventions",
    "PSS2A, PSS2B, PSS2C": "no DYR record of the stabiliser",
    "RENA": "converters, no machine: tests.models.test_wecc_renewable",
    "STAB1": "a step of the reference: tests.models.test_psse_traces",
    "Test01": "GENCLS: only its decay is comparable, by PSS/E's step (tests.models.test_psse_traces)",
}


def records(one: Set, folder: Path) -> str:
    """The records of the set's one machine, as its DYR has them; T''do = 999 has no effect where X'' = X'."""
    bus = "2" if one.four else "102"
    lines = []
    for record in read_dyr(folder / one.folder / one.dyr):
        if str(record.bus) != bus:
            continue
        values = list(record.values)
        if record.name.startswith("GENS") and float(values[1]) > 100:
            values[1] = "0.03"
        lines.append(f"{record.bus} '{record.name}' {record.machine} {' '.join(values)} /")
        if record.name == one.instead[0]:
            lines[-1] = one.instead[1]
    return "\n".join(lines)


def beside(one: Set, folder: Path, scratch: Path) -> tuple[float, float, float]:
    """Root mean square and most of the deviation, and what the source's tests allow [percent of the swing]."""
    network, after = four_buses() if one.four else three_buses()
    rating, source = (500.0, 0.4j) if one.four else (100.0, 0.25j)
    alone = OneMachine(records(one, folder), scratch, network, rating=rating, source=source)
    rows = alone.run(after, UNTIL, every=EVERY)
    t = np.array([row[0] for row in rows])
    ours = np.array([one.signal(device, buses) for _, device, buses in rows])
    table = np.genfromtxt(folder / one.folder / one.csv, delimiter=",", invalid_raise=False)
    # an instant of an event stands there twice: before and after it
    wanted = table[np.searchsorted(table[:, 0], t + 1e-3) - 1, one.column]
    rms, most = deviation(t, ours, wanted)
    return rms, most, 100 * one.allowed / (np.ptp(wanted[t > 1]) / 2)


def reading(one: Set, folder: Path, scratch: Path) -> str:
    """Whether `gfor new` takes the files as they are, or the first words of what it says."""
    files = (folder / one.folder / one.raw, folder / one.folder / one.dyr)
    try:
        write_case(WantedCase(files=files, out=scratch / "case.toml"))
    except (InputError, CaseError) as error:
        return str(error).splitlines()[-1].split(": ", 1)[-1][-90:]
    return "yes"


def main() -> None:
    folder = Path(sys.argv[1])
    print("| Set | Signal | rms [%] | worst [%] | the source's tests allow [%] | read as it is |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        for one in SETS:
            rms, most, allowed = beside(one, folder, scratch)
            print(
                f"| {one.folder}/{one.csv} | {one.signal.__name__} | {rms:.2f} | {most:.2f} | {allowed:.1f} | "
                f"{reading(one, folder, scratch)} |"
            )
    for left, reason in UNREACHED.items():
        print(f"| {left} | | | | | not compared: {reason} |")


if __name__ == "__main__":
    main()
