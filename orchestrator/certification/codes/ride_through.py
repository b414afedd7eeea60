"""Rows of codes that ask for riding through a change of the voltage, for so long and no longer."""

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import voltage
from orchestrator.certification.codes.row import CodeRow, Judge

STRENGTH = 10.0  # short-circuit ratio of the rows: the codes name no grid
AFTER = 5.0  # how long the response is looked at after the last step [s]


def ridden_through(recovery: float | None, last: int = -1) -> tuple[Judge, ...]:
    """``recovery``: time of the code after which the power is back [s]; None where it gives none."""
    back = c.returns("power after the disturbance", recovery, of_code=recovery is not None, events=(last,))
    return c.holds_together(), c.settles(events=(last,)), back


def profile(
    name: str, title: str, clause: str, steps: tuple[tuple[float, float], ...], recovery: float | None
) -> CodeRow:
    """``steps``: time after the first event [s] and voltage of the source [pu] from then on."""
    stop = 1.0 + steps[-1][0] + AFTER
    judges = ridden_through(recovery)
    return CodeRow(name, title, clause, lambda f: voltage(STRENGTH, 0.5, steps, stop), judges)


def step(level: float, lasts: float, clause: str, recovery: float | None) -> CodeRow:
    kind = "dip" if level < 1 else "swell"
    title = f"The source goes to {level:g} pu for {lasts:.4g} s, half power"
    name = f"{kind}_{100 * level:g}".replace(".", "_")
    return profile(name, title, clause, ((0.0, level), (lasts, 1.0)), recovery)
