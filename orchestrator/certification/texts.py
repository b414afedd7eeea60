"""Texts of the report on the study, on the reading of the norm, and on the proof that a certificate gives."""

import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path

from orchestrator.analysis.linear_model import PACKED
from orchestrator.certification.point import CONVERTER, PointResult
from orchestrator.certification.request import REACTANCES

PODS = {"none": "none", "p": "POD-P", "q": "POD-Q", "pq": "POD-P and POD-Q"}

_TEXTS: dict[str, str] = tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))
STUDY, INTEGRITY = _TEXTS["study"], _TEXTS["integrity"]


def reading(pod: str) -> str:
    """The rules as they were applied, with the decisions where the norm leaves a choice."""
    watched = "by_frequency" if "p" in pod.removeprefix("none") else "by_power"
    return _TEXTS["reading"].format(watched=_TEXTS[watched])


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
