"""Texts of the report on the study, on the reading of the norm, and on the proof that a certificate gives."""

from collections.abc import Iterable, Sequence

from orchestrator.analysis.linear_model import PACKED
from orchestrator.certification.point import CONVERTER, PointResult
from orchestrator.certification.request import REACTANCES

PODS = {"none": "none", "p": "POD-P", "q": "POD-Q", "pq": "POD-P and POD-Q"}

STUDY = """<p>SG1 (1500 MVA, 1350 MW, ST4B with PSS2A, no governor) and the converter (1500 MVA, 1350 MW) feed bus 2,
SG2 (5000 MVA, ST1, IEEEG1) feeds bus 3; the line between them has the reactance X_L on 100 MVA and carries 100 MW.
Loads: 2600 MW at bus 2 (1250 MW without the converter) and 4000 MW at bus 3, active power in proportion to the
voltage. Both buses are held at 1.0 pu. The network, the machines and the loads are electromagnetic-transient models in
the frame that turns at rated frequency; all parts are FMUs, coupled every 100 µs. Modes are those of the linearised
coupled system. After 1 s the voltage reference of SG2 rises by 0.02 pu.</p>"""

_BY_FREQUENCY = "A POD-P is active, so the frequency at bus 2 is watched: the turn of its voltage's angle over 20 ms."
_BY_POWER = "No POD-P is active, so SG1's active power at bus 2 is watched."

_READING = """<p><b>The norm's own text was not at hand when this program was written.</b> Its criteria were taken from
a description of section 5.10; where that leaves something open, it was read as stated here. Who files this certificate
compares these rules with the norm's text.</p><ol>
<li>Eigenvalue criterion: every mode from 0.1 to 1.5 Hz of the system with the converter has at least 5 % of damping. A
mode with less is accepted only where the same mode had less than 5 % without the converter already. Modes are matched
by their left and right eigenvectors over the states that both systems have, each with one at most, so that the sum of
the likenesses is largest; a mode without a partner of at least 0.5 counts as introduced. Where another one is about as
like, it is named, and the better damped of both counts for a mode below 5 %. A mode from 0.1 to 1.5 Hz has no partner
below 0.08 or above 1.875 Hz.</li>
<li>An eigenvalue that grows, at whatever frequency, is not accepted where none grew without the converter; nor one
that grows without a communication step and is hidden by it. A point at which it is not known whether the system is
stable is not judged.</li>
<li>{watched}</li>
<li>What is faster than 5 Hz is taken out of the signal first (Butterworth of order 4, forth and back): the norm judges
modes up to 1.5 Hz.</li>
<li>Turning points are those from which the signal moves back by more than 0.1 % of its range after the event. The
first one, towards which the oscillation starts, is left out; the result with it is given as well.</li>
<li>ΔPkMk is the vertical distance from the minimum Mk to the straight line from maximum Pk to maximum Pk+1. Accepted
is ΔP5M5 &lt; 0.25·ΔP1M1. Where there is no fifth swing because no turning point follows for 10 s, a period of the
slowest judged mode, the oscillation has died out, and ΔP5M5 is 0.</li>
<li>Alternatively all modes from 0.1 to 1.5 Hz that the matrix pencil finds in the signal, from half a second after the
event on and with an amplitude of at least 1 % of the largest, have more than 5 %. The time-domain criterion is met by
either way.</li>
<li>A converter passes that meets the eigenvalue criterion and the time-domain criterion at all 13 values of X_L, with
nothing else changed of the study. With fewer, or with a study that was changed, the test is incomplete. Other values of
X_L are shown; they replace none of the 13, and failing there is failing.</li>
<li>The converter has to feed in its 1350 MW from the start, and a damping controller that is said to be active has to
move its output by more than 1e-6 pu, where the FMU shows one.</li>
<li>A response that loses synchronism, grows, or swings for ever is not accepted. The run is watched as by
<code>gfor run</code>. Besides, the frequency at bus 2 stays within 2.5 Hz of its start; and in the last third of the
record neither it nor SG1's active power swings, from peak to peak and without a straight drift, by more than half of
what it does in the first 10 s after the event. The slowest and least damped mode that the norm accepts, 0.1 Hz with
5 %, keeps less.</li>
<li>Modes just outside the judged range, and dampings that the converter lowers by more than two points, are listed and
not judged.</li>
<li>Active loads of constant current become so with a lag of 1 ms; within it they are conductances. Without a lag the
voltage of a bus without capacitance would not be determined. With 5 ms no damping moves by more than 0.2 points.</li>
</ol>"""


def reading(pod: str) -> str:
    """The rules as they were applied, with the decisions where the norm leaves a choice."""
    return _READING.format(watched=_BY_FREQUENCY if "p" in pod.removeprefix("none") else _BY_POWER)


INTEGRITY = """<p><code>gfor verify .</code> in this folder compares all hashes, judges the figures again, and computes
points anew. That guards against accidents: a file that was changed, mixed up or cut off. It is no protection against
forgery: whoever changes a file can compute its hash again. What proves a certificate is the signature of who made it,
and that its points come out again from the FMU.</p>"""


def count(missing: Sequence[float]) -> str:
    return f"{len(REACTANCES) - len(missing)} of {len(REACTANCES)}"


def converter_model(points: Iterable[PointResult]) -> str:
    known = [p for p in points if p.modes is not None]
    boxes = [p for p in known if p.identified is not None]
    if boxes:
        orders = ", ".join(dict.fromkeys(str(p.identified) for p in boxes))
        error = max(p.fit_errors.get(CONVERTER, 0.0) for p in boxes)
        return (
            f"Black box: a model identified at its port, of order {orders}; largest relative fitting error {error:.1e}"
        )
    if any(p.linearised.get(CONVERTER) == PACKED for p in known):
        return (
            "The model packed in the FMU stands for the converter in the modes; it was compared with its own response"
        )
    return "White box: the FMU's own states were perturbed" if known else "Modes of the converter are not known"
