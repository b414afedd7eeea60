"""Python tells who signed a certificate as the command does: the same states, the same signer, the same files."""

import json
import shutil
import subprocess
from datetime import UTC, datetime, timedelta

import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.output.signatures import ssh_keygen
from orchestrator.studies.certification import study as study_module
from tests.studies.certification.fabricated import rings

LAB = "lab@example.org"
pytestmark = pytest.mark.skipif(not ssh_keygen.is_installed(), reason="ssh-keygen is not installed")


def new_key(path):
    words = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", str(path)]
    subprocess.run(words, check=True)
    return path


def public_line(key):
    return key.with_suffix(".pub").read_text("ascii").strip()


@pytest.fixture(scope="module")
def kept(tmp_path_factory, fmu_path):
    """A certificate of one fabricated point, signed, and beside it the key, another key and the signers."""
    place = tmp_path_factory.mktemp("signed")
    key, other = new_key(place / "key"), new_key(place / "other")
    (place / "allowed").write_text(f"{LAB} {public_line(key)}\n", "utf-8")
    (place / "others").write_text(f"{LAB} {public_line(other)}\n", "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", rings)
        issued = gfor.certify(
            fmu_path("gfor"),
            reactances=[0.1],
            pod="q",
            check=False,
            folder=place / "D",
            sign=key,
        )
    assert issued.verdict == "incomplete"
    return place


@pytest.fixture
def place(kept, tmp_path):
    return shutil.copytree(kept, tmp_path / "place")


def verify(place, **wanted):
    return gfor.verify(place / "D", anew=(), **wanted)


def said_by_command(capsys, place, *words):
    code = main(["verify", str(place / "D"), "--files-only", "--json", *map(str, words)])
    return code, json.loads(capsys.readouterr().out)


def test_a_good_signature_names_its_signer_as_the_command_does(place, capsys):
    found = verify(place, signers=place / "allowed")
    assert found.holds
    assert (found.signature.state, found.signature.signer) == ("good", LAB)
    code, said = said_by_command(capsys, place, "--signers", place / "allowed")
    assert (code, said["holds"]) == (3, True)
    assert found.signature.as_json() == said["signature"]
    # without --signers nobody is known, and the figures decide alone
    alone = verify(place)
    assert (alone.holds, alone.signature.state, alone.signature.signer) == (
        True,
        "unknown signer",
        None,
    )


def test_a_certificate_without_a_signature_is_unsigned(place):
    for file in (place / "D").glob("certificate.*"):
        if file.suffix not in (".json", ".html", ".nc") or ".intoto" in file.name:
            file.unlink()
    assert verify(place).holds
    found = verify(place, signers=place / "allowed")
    assert (found.holds, found.signature.state) == (False, "unsigned")
    assert any("nothing says who made it" in fault for fault in found.faults)


def test_a_certificate_that_was_changed_since_does_not_hold(place, capsys):
    with (place / "D" / "certificate.html").open("ab") as page:
        page.write(b"\n")
    for words in ({}, {"signers": place / "allowed"}):
        found = verify(place, **words)
        assert (found.holds, found.signature.state) == (False, "changed")
        assert found.signature.signer is None
    code, said = said_by_command(capsys, place, "--signers", place / "allowed")
    assert (code, said["faults"]) == (5, found.faults)


def test_a_signer_whom_the_file_does_not_name_is_unknown(place):
    found = verify(place, signers=str(place / "others"))
    assert (found.holds, found.signature.state) == (False, "unknown signer")
    assert "does not name" in found.signature.sentence


def test_a_revoked_key_counts_no_longer(place):
    (place / "revoked").write_text(public_line(place / "key") + "\n", "utf-8")
    found = verify(place, signers=place / "allowed", revoked=place / "revoked")
    assert (found.holds, found.signature.state) == (False, "unknown signer")
    assert "revokes" in found.signature.sentence


def test_an_expired_key_counts_at_the_time_that_is_given(place):
    """The certificate is of now, and its signer's key expires in an hour; it is asked for now, and for tomorrow."""
    now = datetime.now(UTC)
    until = f"{now + timedelta(hours=1):%Y%m%d%H%M%S}Z"
    line = f'{LAB} valid-before="{until}" {public_line(place / "key")}\n'
    (place / "until").write_text(line, "utf-8")
    tomorrow = now + timedelta(days=1)
    local = tomorrow.astimezone().replace(tzinfo=None)  # as a clock on the wall shows it
    for at in (tomorrow, local, f"{tomorrow:%Y%m%d%H%M%S}Z"):
        found = verify(place, signers=place / "until", at=at)
        assert (found.holds, found.signature.state) == (False, "unknown signer")
        assert "expired" in found.signature.sentence
    for at in (None, now, f"{now:%Y%m%d%H%M%S}Z"):
        assert verify(place, signers=place / "until", at=at).signature.state == "good"


def test_a_signed_report_is_told_by_its_signature_alone(place):
    report = place / "check.json"
    report.write_text('{"trusted": true}', "utf-8")
    assert main(["sign", str(report), "--sign", str(place / "key")]) == 0
    good = gfor.verify(report, signers=place / "allowed")
    assert (good.holds, good.signature.state, good.signature.signer) == (True, "good", LAB)
    assert not gfor.verify(report).holds
    report.write_text('{"trusted": false}', "utf-8")
    changed = gfor.verify(report, signers=place / "allowed")
    assert (changed.holds, changed.signature.state) == (False, "changed")


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"at": "20261130Z"}, "revoked, at: they say more of the signers of signers; give that"),
        ({"revoked": "x"}, "revoked, at: they say more of the signers of signers; give that"),
        ({"signers": 3}, r"signers = 3; give the path of a file"),
        ({"signers": "nowhere"}, "signers nowhere: it cannot be read"),
        ({"signers": "allowed", "revoked": "nowhere"}, "revoked nowhere: it cannot be read"),
        ({"signers": "allowed", "at": "soon"}, "at: 'soon' is no time; write YYYYMMDD"),
        ({"signers": "allowed", "at": 2026}, "at = 2026; give a time, as YYYYMMDD"),
        ({"signers": "allowed", "at": "00010101Z"}, "at .*01-01: no certificate is of that time"),
        (
            {"signers": "allowed", "at": "99991231Z"},
            "at 9999-12-31: no certificate is of that time",
        ),
        ({"signers": "allowed", "at": datetime.min}, "at .*01-01: no certificate is of that time"),
    ],
)
def test_what_says_nothing_of_a_signer_is_one_error(kept, monkeypatch, wanted, said):
    monkeypatch.chdir(kept)
    with pytest.raises(InputError, match=said):
        gfor.verify("D", anew=(), **wanted)
