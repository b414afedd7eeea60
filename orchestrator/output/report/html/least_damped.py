"""The least damped mode that an answer names: whether two answers mean the same one.

An answer gives the least damped of the modes of a range. In two studies that may be two modes, and the difference of
their figures is then no change of either."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.linear.spectra.modes import damping_percent

_FREQUENCY = 0.3
"""Two frequencies of one mode differ by less than this part; a certificate compares modes with and without POD so."""

_ALIKE = 0.5
"""Least part of the participation that two results of one mode have in common."""


@dataclass(frozen=True)
class LeastDamped:
    """A mode's frequency [Hz], damping [%] and the share of each component; no shares where a result has none."""

    frequency_hz: float
    damping_percent: float
    shares: Mapping[str, float]

    @classmethod
    def of(cls, mode: Mapping[str, Any]) -> LeastDamped:
        shares = mode.get("components") or {}
        return cls(mode["frequency_hz"], mode["damping_percent"], dict(shares))

    @classmethod
    def of_design_mode(cls, mode: Mapping[str, Any]) -> LeastDamped:
        """Take a mode that a design over points gives: an eigenvalue [rad/s] and who takes part most."""
        value, who = complex(mode["real"], mode["imag"]), mode.get("who")
        shares = {who: 1.0} if who else {}
        return cls(value.imag / math.tau, damping_percent(value), shares)

    def as_json(self) -> dict[str, Any]:
        """Return what `of` reads."""
        return {
            "frequency_hz": self.frequency_hz,
            "damping_percent": self.damping_percent,
            "components": dict(self.shares),
        }

    @property
    def words(self) -> str:
        who = max(self.shares, key=lambda name: self.shares[name], default="")
        named = f" ({who})" if who else ""
        return f"{self.frequency_hz:.3f} Hz, {self.damping_percent:.2f} %{named}"

    def is_like(self, other: LeastDamped) -> bool:
        """Return whether it is the same mode, by frequency and by who takes part."""
        apart = abs(self.frequency_hz - other.frequency_hz)
        if apart > _FREQUENCY * max(self.frequency_hz, other.frequency_hz):
            return False
        if not (self.shares and other.shares):
            return True
        common = sum(min(x, other.shares.get(name, 0.0)) for name, x in self.shares.items())
        most = min(sum(self.shares.values()), sum(other.shares.values()))
        return common >= _ALIKE * most


def other_modes(before: Sequence[LeastDamped], now: Sequence[LeastDamped]) -> list[str]:
    """In words, the answers' modes that are not the same ones as before."""
    return [
        f"figures of another mode: {was.words} before, {one.words} now"
        for was, one in zip(before, now, strict=False)
        if not was.is_like(one)
    ]
