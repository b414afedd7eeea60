"""How the linear models of the components were found, in words."""

from collections.abc import Mapping

from orchestrator.linear.models.linear_model import DIRECTIONAL, IDENTIFIED, PACKED, PERTURBED

_HOW = {
    DIRECTIONAL: "from its FMU's directional derivatives, which were compared with differences of its variables",
    PACKED: "from the model packed in its FMU, which was compared with the FMU's own response",
    IDENTIFIED: "identified from its response at its inputs and outputs (its states are those of the fitted model)",
}
_SHOWN = 6


def exceptions_in_words(
    sources: Mapping[str, str], fit_errors: Mapping[str, float] | None = None
) -> str | None:
    """One sentence about the components that were not perturbed; None where all were."""
    parts = []
    for source, how in _HOW.items():
        names = [name for name, found in sources.items() if found == source]
        if names:
            parts.append(f"{_names_with_errors(names, fit_errors or {})} {how}")
    if not parts:
        return None
    rest = "; all others by perturbing the running FMUs" if PERTURBED in sources.values() else ""
    return f"Linear models: {'; '.join(parts)}{rest}."


def _names_with_errors(names: list[str], fit_errors: Mapping[str, float]) -> str:
    shown = [
        f"{n} (fitting error {fit_errors[n]:.1e})" if n in fit_errors else n for n in names[:_SHOWN]
    ]
    return ", ".join(shown) + (f" … {len(names)} in all" if len(names) > _SHOWN else "")
