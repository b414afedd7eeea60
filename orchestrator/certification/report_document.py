"""Parts of a certificate beside the criteria: the client, the FMU, the environment of the computation, and how to check
it."""

from collections.abc import Mapping
from html import escape

from orchestrator.binding.binding import read_table
from orchestrator.certification import texts
from orchestrator.certification.case_file import BINDING, FMU, WITH
from orchestrator.certification.environment import environment
from orchestrator.certification.figures import commands
from orchestrator.certification.parameters import parameter_rows
from orchestrator.certification.point import FREQUENCY
from orchestrator.certification.study import Certification
from orchestrator.fmi.origin import read_origin
from orchestrator.fmi.port import BoundDescription
from orchestrator.fmi.values import Scalar, as_text
from orchestrator.report.html.elements import table
from orchestrator.report.linearised import exceptions_in_words

_LINE = '<span class="blank"></span>'  # A line to be filled in by hand

Hashes = Mapping[str, str | None]


def details(c: Certification) -> str:
    rows = [[label, escape(text).replace("\n", "<br>") or _LINE] for label, text in c.details.rows()]
    rows += [[f"Signature of the {who}", _LINE] for who in ("tester", "applicant")]
    return table("Filled in from the file of --details, or by hand", ["", ""], rows, left=2)


def signal_name(signal: str) -> str:
    return "the frequency at bus 2" if signal == FREQUENCY else "SG1's active power"


def converter(c: Certification, hashes: Hashes) -> str:
    origin = read_origin(c.description.path)
    values = {**c.request.values, **c.controllers.settings, **c.request.study_values}
    given = {
        "FMU": c.request.fmu.name, "Model": c.description.model_name, "Description": origin.description,
        "Author": origin.author, "Version": origin.version, "Made by": origin.generation_tool,
        "Made on": origin.generated, "Copyright": origin.copyright, "License": origin.license,
        "FMI": f"{origin.fmi_version}, co-simulation", "Guid": c.description.guid, "SHA-256": hashes[FMU],
        "Rating": _rating(c), "Voltage": _voltage(c),
        "Binding": c.request.binding.name if c.request.binding else "none: the port is ours",
        "Values set": ", ".join(f"{k} = {as_text(v)}" for k, v in values.items()) or "none",
        "Damping controllers": f"{texts.PODS[c.pod]}: {c.controllers.source}",
        "Watched in time": signal_name(c.signal),
        "In the modes": texts.converter_model(c.points[WITH, v.X_L] for v in c.verdicts),
        "Linear models": exceptions_in_words(c.linearised, c.fit_errors)
        or ("all by perturbing the running FMUs" if c.linearised else "not recorded"),
    }  # fmt: skip
    rows = [[escape(name), escape(str(value)) or '<span class="soft">not said</span>'] for name, value in given.items()]
    return table("The converter", ["", ""], rows, left=2)


def _rating(c: Certification) -> str:
    used = float(c.values.get("converter.S_n", 0.0))
    if isinstance(c.description, BoundDescription):
        return f"{c.description.port.rating:g} MVA by the binding; {used:g} MVA in the study"
    info = c.description.variables.get("S_n")
    return f"{info.start if info else '?'} MVA by the FMU; {used:g} MVA in the study"


def _voltage(c: Certification) -> str:
    if c.request.binding is None:
        return "per unit of the bus; the FMU has no rated voltage"
    given = read_table(c.request.binding).rating.V_n
    return f"{given} (V_n of the binding)" if given is not None else "per unit of the bus; the binding gives no V_n"


def parameters(c: Certification) -> str:
    rows = [
        [escape(r.name), _text(r.start), f"<b>{_text(r.used)}</b>" if r.changed_by else _text(r.used),
         escape(r.unit), escape(r.changed_by or "–"), escape(r.description)] for r in parameter_rows(c)
    ]  # fmt: skip
    columns = ["Parameter", "In the file", "Used", "Unit", "Changed by", "Description"]
    changed = sum(1 for r in parameter_rows(c) if r.changed_by)
    return table(f"All {len(rows)} parameters by the FMU's own names, {changed} of them given a value", columns, rows)


def _text(value: Scalar | None) -> str:
    if value is None:
        return "–"
    return escape(as_text(value) if not isinstance(value, float) else f"{value:.12g}")


def binding(c: Certification, hashes: Hashes) -> str:
    if c.request.binding is None:
        return "<p>None: the FMU has the variables of our port.</p>"
    text = escape(c.request.binding.read_text(encoding="utf-8"))
    return f"<p>{escape(c.request.binding.name)}, SHA-256 {hashes[BINDING]}</p><pre>{text}</pre>"


def acceptance(c: Certification) -> str:
    if c.acceptance is None:
        return "<p>They were not run (--no-check).</p>"
    marks = {"fail": "bad", "pass": "good"}
    rows = [
        [escape(r["check"]), f'<span class="{marks.get(r["verdict"], "soft")}">{escape(r["verdict"])}</span>',
         escape(f"{r['fault']}: {r['evidence']}" if r["fault"] else r["evidence"])] for r in c.acceptance.checks
    ]  # fmt: skip
    said = "No check failed." if c.acceptance.trusted else f"FAILED: {', '.join(c.acceptance.faults)}."
    style = "good" if c.acceptance.trusted else "bad"
    listed = table("gfor fmu check", ["Check", "Verdict", "What was seen"], rows, left=3)
    return f'<p class="{style}">{escape(said)}</p>{listed}'


def provenance(c: Certification, hashes: Hashes) -> str:
    machine = table("Computed on", ["", ""], [[escape(k), escape(v)] for k, v in environment().items()], left=2)
    files = table("SHA-256 of the files beside this page", ["File", "SHA-256"],
                  [[escape(name), str(value)] for name, value in hashes.items()], left=2)  # fmt: skip
    worst = max((p.residual for p in c.points.values()), default=float("nan"))
    X_L = c.verdicts[0].X_L if c.verdicts else 0.1
    having = c.points[WITH, X_L]
    again = commands(X_L, WITH, identified=having.identified is not None)
    listed = "".join(f"<li>{name}: <code>{escape(text)}</code></li>" for name, text in again.items())
    text = escape(c.case.read_text(encoding="utf-8"))
    return (
        f"{machine}{files}<p>Steady states hold to {worst:.1e} pu in one communication step. Any point can be computed "
        f"again in the folder of this page; the case file holds every value that was set. For X_L = {X_L:g} pu:</p>"
        f"<ul>{listed}</ul>{texts.INTEGRITY}"
        f"<details data-print><summary>Case file</summary><pre>{text}</pre></details>"
    )
