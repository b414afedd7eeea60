"""What is said of the page of a certificate that another version issued."""

from orchestrator.studies.certification.environment import CODE, environment
from orchestrator.studies.certification.page_again import look_at_page


def said(tmp_path, stated):
    seen = look_at_page(
        tmp_path, {"format": "a code's", "environment": stated, "details": {}}, None
    )
    assert not seen.fault
    return seen.unproved


def test_it_names_both_programs_and_why_the_page_is_not_compared(tmp_path):
    older = {**environment(), "gfor-cosim": "0.2.0", "Commit": "0123456789" * 4, CODE: "other"}
    text = said(tmp_path, older)
    assert text.startswith(
        "certificate.html: a view, not proved: gfor-cosim 0.2.0 at commit 01234567"
    )
    assert f"gfor-cosim {environment()['gfor-cosim']}" in text.partition(" wrote it, and ")[2]
    assert "has other code, whose words and pictures may differ" in text


def test_a_version_from_a_package_and_none_at_all(tmp_path):
    packed = {"gfor-cosim": "0.2.0", "Commit": "none: installed from a package", CODE: "other"}
    assert ": gfor-cosim 0.2.0 wrote it" in said(tmp_path, packed)
    assert ": a version that it does not name wrote it" in said(tmp_path, {})
