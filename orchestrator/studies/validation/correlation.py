"""For how long a sample of noise is like the next ones."""

from orchestrator.core.arrays import Numbers


def correlation_length(values: Numbers) -> float:
    """1 + 2·Σρ [samples], summed until the correlation is gone (Sokal's window); at least 1."""
    deviation = values - values.mean()
    total = float(deviation @ deviation)
    if total <= 0 or len(values) < 4:
        return 1.0
    length = 1.0
    for lag in range(1, len(values) // 2):
        length += 2 * float(deviation[lag:] @ deviation[:-lag]) / total
        if lag >= 5 * length:
            break
    return max(1.0, length)
