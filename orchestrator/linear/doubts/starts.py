"""All warnings of a system at its start: exciters, limiters, feedbacks and motors."""

from orchestrator.linear.doubts.excitation_limiters import limiter_warnings
from orchestrator.linear.doubts.external_exciters import start_warnings
from orchestrator.linear.doubts.field_feedbacks import feedback_warnings
from orchestrator.linear.doubts.motor_starts import motor_warnings
from orchestrator.systems.coupling.master import Master


def warnings_at_start(master: Master) -> tuple[str, ...]:
    """Warn of all that makes modes of an operating point doubtful and shows where a system starts."""
    return (
        *start_warnings(master),
        *limiter_warnings(master),
        *feedback_warnings(master),
        *motor_warnings(master),
    )
