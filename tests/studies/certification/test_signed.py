"""A certificate says who made it: each way in which that may be wrong is planted, and has its sentence."""

import base64
import json
import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

import orchestrator as gfor_api
from orchestrator.core.file_hashes import sha256_of
from orchestrator.face.cli import main
from orchestrator.output.signatures import ssh_keygen
from orchestrator.output.signatures.public_key import public_key_of
from orchestrator.output.signatures.sshsig import as_armour, sign_with
from orchestrator.studies.certification import kinds, verification
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.case_file import FMU
from orchestrator.studies.certification.files import HTML, RESPONSES, signatures_of, write_sealed
from orchestrator.studies.certification.form import case_files
from tests.studies.certification.fabricated import rings
from tests.studies.certification.test_recomputing import BOUND

LAB = "lab@example.org"


def write_key(path, key, form=PrivateFormat.OpenSSH):
    path.write_bytes(key.private_bytes(Encoding.PEM, form, NoEncryption()))
    path.chmod(0o600)
    return path


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Private keys by name, as their owners have them, and the lines of their public halves."""
    folder = tmp_path_factory.mktemp("keys")
    made = {
        "ed25519": ed25519.Ed25519PrivateKey.generate(),
        "ecdsa": ec.generate_private_key(ec.SECP256R1()),
        "rsa": rsa.generate_private_key(65537, 2048),
        "other": ed25519.Ed25519PrivateKey.generate(),
    }
    for name, key in made.items():
        write_key(folder / name, key)
        write_key(folder / f"{name}.pem", key, PrivateFormat.PKCS8)
        (folder / f"{name}.pub").write_text(public_key_of(key).line + "\n", "ascii")
    return folder


def line_of(keys, name):
    return (keys / f"{name}.pub").read_text("ascii").strip()


@pytest.fixture(scope="module")
def original(tmp_path_factory, fmu_path):
    """A certificate of one fabricated point, without a signature."""
    folder = tmp_path_factory.mktemp("certificate")
    (folder / "mine.toml").write_text(BOUND, encoding="utf-8")
    words = ["certify", fmu_path("gfor"), "--binding", folder / "mine.toml", "--no-check"]
    words += ["--reactances", "0.1", "--workers", "1", "--pod", "q", "--out", folder / "out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", rings)
        assert main(list(map(str, words))) == 3
    return folder / "out"


@pytest.fixture(scope="module", autouse=True)
def judged_once():
    """Equal files that hold are judged again once: who signed them changes nothing of that.

    `test_verification` has what judging again finds."""
    judge, known = verification._judged_again, {}

    def judged(folder, content, said, views):
        names = {FMU, RESPONSES, HTML, *case_files(content), *content["files"]}
        files = {name: sha256_of(folder / name) for name in names if (folder / name).is_file()}
        asked = json.dumps([content, files], sort_keys=True)
        if asked not in known:
            words, shown = [], []
            if faults := judge(folder, content, words, shown):
                return faults
            known[asked] = words, shown
        words, shown = known[asked]
        said.extend(words)
        views.extend(shown)
        return []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verification, "_judged_again", judged)
        yield


@pytest.fixture(scope="module")
def signed(original, keys, tmp_path_factory):
    folder = shutil.copytree(original, tmp_path_factory.mktemp("signed") / "out")
    assert main(["sign", str(folder), "--sign", str(keys / "ed25519")]) == 0
    return folder


@pytest.fixture
def certificate(signed, tmp_path, monkeypatch):
    monkeypatch.setattr(kinds.POINTS, "compute", rings)
    return shutil.copytree(signed, tmp_path / "certificate")


@pytest.fixture
def signers(keys, tmp_path):
    def write(*lines):
        lines = lines or (f"{LAB} {line_of(keys, 'ed25519')}",)
        (tmp_path / "allowed").write_text("\n".join(["# who may", *lines, ""]), "utf-8")
        return tmp_path / "allowed"

    return write


def verified(gfor, folder, *arguments):
    code, text, error = gfor("verify", folder, "--json", "--files-only", *arguments)
    assert code in (3, 5), error
    return code, json.loads(text)


def seen(gfor, folder, *arguments):
    """Exit code, state and sentence."""
    code, found = verified(gfor, folder, *arguments)
    assert found["holds"] == (code == 3)
    return code, found["signature"]["state"], found["signature"]["sentence"]


def test_a_certificate_is_good_with_its_signer_and_unknown_without(certificate, signers, gfor):
    code, found = verified(gfor, certificate, "--signers", signers())
    view, points = found["unproved"]
    assert points.startswith("points/")
    assert (code, found["holds"], "a view, not proved" in view) == (3, True, True)
    assert (found["signature"]["state"], found["signature"]["signer"]) == ("good", LAB)
    code, found = verified(gfor, certificate)
    assert (code, found["signature"]["state"]) == (3, "unknown signer")
    code, text, _ = gfor("verify", certificate, "--signers", signers(), "--workers", 1)
    assert code == 3
    assert "Its figures, verdicts and files are those that were signed." in text


def test_certify_signs_and_a_new_certificate_takes_the_old_signature_away(
    tmp_path, fmu_path, keys, signers, gfor, monkeypatch
):
    monkeypatch.setattr(study_module, "compute_point", rings)
    words = ["certify", fmu_path("gfor"), "--no-check", "--pod", "q", "--reactances", "0.1"]
    words += ["--workers", 1, "--out", tmp_path / "D"]
    assert gfor(*words, "--sign", keys / "ed25519")[0] == 3
    assert seen(gfor, tmp_path / "D", "--signers", signers())[:2] == (3, "good")
    assert gfor(*words)[0] == 3
    assert seen(gfor, tmp_path / "D", "--signers", signers())[:2] == (5, "unsigned")


def test_nothing_is_computed_for_a_key_that_is_lost(tmp_path, fmu_path, gfor):
    words = ["certify", fmu_path("gfor"), "--no-check", "--out", tmp_path / "D"]
    code, _, said = gfor(*words, "--sign", tmp_path / "lost")
    assert code == 2
    assert "a key that is lost cannot be had again" in " ".join(said.split())
    assert not (tmp_path / "D").exists()
    (tmp_path / "note").write_text("no key")
    code, _, said = gfor(*words, "--sign", tmp_path / "note")
    assert (code, "holds no private key" in " ".join(said.split())) == (2, True)


@pytest.mark.parametrize("kind", ["ed25519", "ecdsa", "rsa"])
@pytest.mark.parametrize("form", ["", ".pem"])
@pytest.mark.parametrize("by_openssh", [False, True])
def test_each_kind_of_key_signs(
    original, keys, signers, gfor, tmp_path, monkeypatch, kind, form, by_openssh
):
    """By OpenSSH's program, and without it by the library."""
    if by_openssh and not ssh_keygen.is_installed():
        pytest.skip("ssh-keygen is not installed")
    if not by_openssh:
        monkeypatch.setattr(ssh_keygen, "is_installed", lambda: False)
    folder = shutil.copytree(original, tmp_path / "out")
    assert gfor("sign", folder, "--sign", keys / f"{kind}{form}")[0] == 0
    allowed = signers(f"{LAB} {line_of(keys, kind)}")
    assert seen(gfor, folder, "--signers", allowed)[:2] == (3, "good")
    other = signers(f"{LAB} {line_of(keys, 'other')}")
    assert seen(gfor, folder, "--signers", other)[:2] == (5, "unknown signer")
    edited(folder, lambda c: c["details"].update(applicant="Other"))
    assert seen(gfor, folder, "--signers", allowed)[:2] == (5, "changed")


def test_without_the_library_openssh_checks(certificate, signers, gfor, monkeypatch):
    if not ssh_keygen.is_installed():
        pytest.skip("ssh-keygen is not installed")
    monkeypatch.setattr("orchestrator.output.signatures.checking.find_spec", lambda name: None)
    assert seen(gfor, certificate, "--signers", signers())[:2] == (3, "good")
    spoil(certificate, lambda sig: sig[:-1] + bytes([sig[-1] ^ 1]))
    assert seen(gfor, certificate, "--signers", signers())[:2] == (5, "changed")


def edited(folder, change):
    """Change the record as whoever knows this program can: every hash fits again."""
    path = folder / "certificate.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    content["files"] = {name: sha256_of(folder / name) for name in content["files"]}
    del content["seal"]
    write_sealed(content, path)


def envelope_of(folder):
    return json.loads((folder / "certificate.intoto.json").read_text("utf-8"))


def put(folder, envelope):
    """Write an envelope, with the files for ssh-keygen as they have to be."""
    (folder / "certificate.intoto.json").write_text(json.dumps(envelope), "utf-8")
    payload, kind = base64.b64decode(envelope["payload"]), envelope["payloadType"]
    signed = f"DSSEv1 {len(kind)} {kind} {len(payload)} ".encode() + payload
    for file in folder.glob("certificate.pae*"):
        file.unlink()
    (folder / "certificate.pae").write_bytes(signed)
    own = [base64.b64decode(one["sig"]) for one in envelope["signatures"]]
    for k, content in enumerate([one for one in own if one.startswith(b"SSHSIG")], start=1):
        name = f"certificate.pae.{'' if k == 1 else f'{k}.'}sig"
        (folder / name).write_text(as_armour(content), "ascii")


def spoil(folder, change):
    envelope = envelope_of(folder)
    sig = base64.b64decode(envelope["signatures"][0]["sig"])
    envelope["signatures"][0]["sig"] = base64.b64encode(change(sig)).decode()
    put(folder, envelope)


def a_value(folder):
    edited(folder, lambda content: content["values"].update({"droop.R_f": 0.05}))


def a_detail(folder):
    edited(folder, lambda content: content["details"].update(applicant="Other GmbH"))


def the_page(folder):
    page = folder / "certificate.html"
    page.write_text(page.read_text("utf-8").replace("</style>", "b{display:none}</style>"), "utf-8")
    edited(folder, lambda content: None)


def the_binding(folder):
    binding = folder / "vendor.toml"
    binding.write_text(binding.read_text("utf-8") + "\n# another\n", "utf-8")
    edited(folder, lambda content: None)


def the_payload(folder):
    envelope = envelope_of(folder)
    statement = json.loads(base64.b64decode(envelope["payload"]))
    statement["predicate"]["verdict"] = "passes"
    envelope["payload"] = base64.b64encode(json.dumps(statement).encode()).decode()
    put(folder, envelope)


def the_statement_and_the_record(folder):
    """Both say the same again, and the signature is the old one."""
    a_detail(folder)
    old = envelope_of(folder)
    shutil.rmtree(folder / "points", ignore_errors=True)
    from orchestrator.studies.certification.statement import as_bytes, statement_of  # noqa: PLC0415

    content = json.loads((folder / "certificate.json").read_text("utf-8"))
    old["payload"] = base64.b64encode(as_bytes(statement_of(folder, content))).decode()
    put(folder, old)


def a_bit(folder):
    spoil(folder, lambda sig: sig[:-1] + bytes([sig[-1] ^ 1]))


def no_signature_in_it(folder):
    put(folder, {**envelope_of(folder), "signatures": []})


def no_envelope(folder):
    (folder / "certificate.intoto.json").unlink()


def another_type(folder):
    put(folder, {**envelope_of(folder), "payloadType": "text/plain"})


def other_bytes_for_openssh(folder):
    (folder / "certificate.pae").write_bytes(b"DSSEv1 1 a 1 b")


def a_further_file_for_openssh(folder):
    shutil.copy(folder / "certificate.pae.sig", folder / "certificate.pae.2.sig")


def no_json(folder):
    (folder / "certificate.intoto.json").write_text("[" * 100_000, "utf-8")


def a_link(folder):
    (folder / "certificate.pae").rename(folder.parent / "elsewhere")
    (folder / "certificate.pae").symlink_to(folder.parent / "elsewhere")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (a_value, "changed since it was signed: certificate.json"),
        (a_detail, "changed since it was signed: certificate.json"),
        (the_page, "certificate.json, certificate.html"),
        (the_binding, "vendor.toml"),
        (the_payload, "though every hash is the same"),
        (the_statement_and_the_record, "is not one of these bytes"),
        (a_bit, "is not one of these bytes"),
        (no_signature_in_it, "it has no signature"),
        (no_envelope, "certificate.intoto.json is missing"),
        (another_type, "and not application/vnd.in-toto+json"),
        (other_bytes_for_openssh, "certificate.pae: not as certificate.intoto.json has it"),
        (a_further_file_for_openssh, "certificate.pae.2.sig: not as certificate.intoto.json"),
        (no_json, "it is no envelope"),
        (a_link, "certificate.pae: a link is no signature's file"),
    ],
)
@pytest.mark.parametrize("named", [True, False])
def test_what_was_changed_since_does_not_hold(certificate, signers, gfor, change, said, named):
    change(certificate)
    code, state, sentence = seen(gfor, certificate, *(["--signers", signers()] if named else []))
    assert (code, state) == (5, "changed")
    assert said in sentence


def test_who_takes_the_signature_away_has_none(certificate, signers, gfor):
    signatures_of(certificate).remove()
    assert seen(gfor, certificate, "--signers", signers())[:2] == (5, "unsigned")
    assert seen(gfor, certificate)[:2] == (3, "unsigned")


def test_a_forger_with_a_key_of_his_own_is_unknown(certificate, keys, signers, gfor):
    signatures_of(certificate).remove()
    assert gfor("sign", certificate, "--sign", keys / "other")[0] == 0
    code, state, sentence = seen(gfor, certificate, "--signers", signers())
    assert (code, state) == (5, "unknown signer")
    assert "does not name" in sentence


def test_a_forger_who_writes_the_signers_key_beside_his_own_signature(
    certificate, keys, signers, gfor
):
    """The keyid is a hint; the key is in the signature."""
    signatures_of(certificate).remove()
    gfor("sign", certificate, "--sign", keys / "other")
    envelope = envelope_of(certificate)
    signer = public_key_of(_public(keys, "ed25519"))
    envelope["signatures"][0]["keyid"] = signer.fingerprint
    put(certificate, envelope)
    assert seen(gfor, certificate, "--signers", signers())[:2] == (5, "unknown signer")


def _public(keys, name):
    from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415
        load_ssh_public_key,
    )

    return load_ssh_public_key((keys / f"{name}.pub").read_bytes())


def _private(keys, name):
    from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415
        load_ssh_private_key,
    )

    return load_ssh_private_key((keys / name).read_bytes(), None)


def test_the_signature_of_another_certificate_is_one(certificate, keys, signers, gfor, tmp_path):
    """Its FMU is another, so that its signature says nothing of this one."""
    other = shutil.copytree(certificate, tmp_path / "other")
    signatures_of(other).remove()
    content = (other / "converter.fmu").read_bytes()
    (other / "converter.fmu").write_bytes(content[:-2] + b"\x01\x00x")  # a comment of the archive
    edited(other, lambda content: None)
    page = other / "certificate.html"
    page.write_text(page.read_text("utf-8").replace(sha256_of(certificate / "converter.fmu"), "0"))
    for name in signatures_of(certificate).names():
        shutil.copy(certificate / name, other / name)
    code, state, sentence = seen(gfor, other, "--signers", signers())
    assert (code, state) == (5, "changed")
    assert "it is the signature of another certificate" in sentence


def test_the_signature_of_a_file_is_none_of_a_certificate(
    certificate, keys, signers, gfor, tmp_path
):
    report = tmp_path / "report.json"
    report.write_text("{}", "utf-8")
    assert gfor("sign", report, "--sign", keys / "ed25519")[0] == 0
    for name in signatures_of(certificate).names():
        its = report.with_name(name.replace("certificate", "report.json"))
        shutil.copy(its, certificate / name)
    code, state, sentence = seen(gfor, certificate, "--signers", signers())
    assert (code, state) == (5, "changed")
    assert "it is no signature of a certificate: it is one of report.json" in sentence


def test_a_signature_made_for_something_else_is_none(certificate, keys, signers, gfor):
    message = (certificate / "certificate.pae").read_bytes()
    made = sign_with(_private(keys, "ed25519"), message, "git")
    spoil(certificate, lambda sig: made)
    code, state, sentence = seen(gfor, certificate, "--signers", signers())
    assert (code, state) == (5, "changed")
    assert "was made for 'git'" in sentence


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ('valid-before="20200101Z"', "expired on 2020-01-01 00:00"),
        ('valid-after="29990101Z"', "is valid from 2999-01-01 00:00"),
        ('namespaces="git"', "may sign for git only"),
        ('namespaces="*,!certificate@gfor-cosim"', "may sign for"),
        ("cert-authority", "one of an authority"),
    ],
)
def test_a_key_that_does_not_count_now(certificate, keys, signers, gfor, options, said):
    allowed = signers(f"{LAB} {options} {line_of(keys, 'ed25519')}")
    code, found = verified(gfor, certificate, "--signers", allowed)
    assert (code, found["signature"]["state"]) == (5, "unknown signer")
    assert said in found["signature"]["sentence"]
    assert found["signature"]["signer"] == LAB


def test_an_expired_key_counts_at_a_time_that_is_known_from_elsewhere(
    certificate, keys, signers, gfor
):
    tomorrow = f"{datetime.now(UTC) + timedelta(days=1):%Y%m%d}"
    allowed = signers(f'{LAB} valid-before="{tomorrow}Z" {line_of(keys, "ed25519")}')
    later = f"{datetime.now(UTC) + timedelta(days=2):%Y%m%d}Z"
    assert seen(gfor, certificate, "--signers", allowed)[:2] == (3, "good")
    assert seen(gfor, certificate, "--signers", allowed, "--at", later)[:2] == (5, "unknown signer")


def test_another_line_that_allows_the_key_is_enough(certificate, keys, signers, gfor):
    line = line_of(keys, "ed25519")
    allowed = signers(f'old@example.org valid-before="20200101" {line}', f"{LAB} {line}")
    code, found = verified(gfor, certificate, "--signers", allowed)
    assert (code, found["signature"]["signer"]) == (3, LAB)


@pytest.mark.parametrize("form", ["key", "fingerprint"])
def test_a_revoked_key_does_not_count(certificate, keys, signers, gfor, tmp_path, form):
    revoked = tmp_path / "revoked"
    own = public_key_of(_public(keys, "ed25519"))
    revoked.write_text(f"{own.line if form == 'key' else own.fingerprint}\n")
    asked = ["--signers", signers(), "--revoked", revoked]
    code, state, sentence = seen(gfor, certificate, *asked)
    assert (code, state) == (5, "unknown signer")
    assert "revokes" in sentence
    revoked.write_text(f"{line_of(keys, 'other')}\n")
    assert seen(gfor, certificate, *asked)[:2] == (3, "good")


def test_a_revocation_list_of_openssh_counts(certificate, keys, signers, gfor, tmp_path):
    if not ssh_keygen.is_installed():
        pytest.skip("ssh-keygen is not installed")
    for name, code in (("ed25519", 5), ("other", 3)):
        listed = tmp_path / name
        words = ["ssh-keygen", "-q", "-k", "-f", listed, keys / f"{name}.pub"]
        subprocess.run(words, check=True, capture_output=True)
        asked = ["--signers", signers(), "--revoked", listed]
        assert seen(gfor, certificate, *asked)[0] == code


def test_a_clock_that_is_wrong_is_said(certificate, keys, signers, gfor):
    signatures_of(certificate).remove()
    page = certificate / "certificate.html"
    before = json.loads((certificate / "certificate.json").read_text("utf-8"))
    from orchestrator.studies.certification.files import figures_hash  # noqa: PLC0415

    after = {**before, "made": "2999-01-01T00:00:00+00:00"}
    text = page.read_text("utf-8").replace(figures_hash(before), figures_hash(after))
    page.write_text(text, "utf-8")
    edited(certificate, lambda content: content.update(made=after["made"]))
    content = json.loads((certificate / "certificate.json").read_text("utf-8"))
    from orchestrator.studies.certification.signed import sign_folder  # noqa: PLC0415

    sign_folder(certificate, content, keys / "ed25519")
    code, state, sentence = seen(gfor, certificate, "--signers", signers())
    assert (code, state) == (5, "unknown signer")
    assert "a clock is wrong" in sentence


def test_two_sign_and_each_is_named(certificate, keys, signers, gfor):
    for name in ("ecdsa", "rsa.pem", "ecdsa"):
        assert gfor("sign", certificate, "--sign", keys / name)[0] == 0
    lines = [f"{name}@example.org {line_of(keys, name)}" for name in ("ed25519", "ecdsa", "rsa")]
    code, found = verified(gfor, certificate, "--signers", signers(*lines))
    assert code == 3
    assert [one["state"] for one in found["signature"]["signatures"]] == ["good"] * 3
    code, found = verified(gfor, certificate, "--signers", signers(lines[1]))
    states = sorted(one["state"] for one in found["signature"]["signatures"])
    assert (code, states) == (3, ["good", "unknown signer", "unknown signer"])
    assert found["signature"]["signer"] == "ecdsa@example.org"
    a_bit(certificate)  # of a signature that nobody needs: somebody was at it all the same
    assert seen(gfor, certificate, "--signers", signers(lines[1]))[:2] == (5, "changed")


def second(change):
    """Change the second signature in the envelope."""

    def changed(folder):
        envelope = envelope_of(folder)
        change(envelope["signatures"][1])
        put(folder, envelope)

    return changed


def wrong(entry):
    sig = base64.b64decode(entry["sig"])
    entry["sig"] = base64.b64encode(sig[:-1] + bytes([sig[-1] ^ 1])).decode()


def without_its_form(entry):
    """Its first byte is another, so that it is no signature of SSH any more."""
    entry["sig"] = base64.b64encode(b"T" + base64.b64decode(entry["sig"])[1:]).decode()
    entry.pop("publicKey", None)


def without_its_key(entry):
    del entry["publicKey"]


def wrong_without_its_key(entry):
    wrong(entry)
    del entry["publicKey"]


def with_a_damaged_key(entry):
    entry["publicKey"] = entry["publicKey"][:-9]


def with_another_name(entry):
    entry["keyid"] = "SHA256:0"
    entry.pop("publicKey", None)


EXPIRED = 'valid-before="20200101Z" '


@pytest.mark.parametrize(
    ("other", "change", "known", "state", "said"),
    [
        ("ecdsa", None, "", "good", "signature 2 of 2: signed by other@example.org"),
        ("ecdsa", None, None, "good", "signature 2 of 2: it is signed by the key SHA256:"),
        ("ecdsa", None, EXPIRED, "good", "of other@example.org expired on 2020-01-01 00:00"),
        ("ecdsa", second(wrong), "", "changed", "is not one of these bytes"),
        ("ecdsa", second(wrong), None, "changed", "is not one of these bytes"),
        ("ecdsa", second(wrong), EXPIRED, "changed", "is not one of these bytes"),
        ("ecdsa", second(without_its_form), "", "changed", "is not one of these bytes"),
        ("ecdsa", second(without_its_form), None, "good", "it counts for nothing"),
        ("ecdsa", a_detail, "", "changed", "changed since it was signed: certificate.json"),
        ("rsa.pem", None, "", "good", "signature 2 of 2: signed by other@example.org"),
        ("rsa.pem", None, None, "good", "signature 2 of 2: it is signed by the key SHA256:"),
        ("rsa.pem", None, EXPIRED, "good", "of other@example.org expired on 2020-01-01 00:00"),
        ("rsa.pem", second(wrong), "", "changed", "is not one of these bytes"),
        ("rsa.pem", second(wrong), None, "changed", "is not one of these bytes"),
        ("rsa.pem", second(wrong), EXPIRED, "changed", "is not one of these bytes"),
        ("rsa.pem", second(without_its_key), None, "good", "it counts for nothing"),
        ("rsa.pem", second(wrong_without_its_key), None, "good", "it counts for nothing"),
        ("rsa.pem", second(wrong_without_its_key), "", "changed", "is not one of these bytes"),
        ("rsa.pem", second(with_a_damaged_key), None, "changed", "the signature is damaged"),
        ("rsa.pem", second(with_another_name), "", "good", "signed by other@example.org"),
        ("rsa.pem", the_payload, "", "changed", "though every hash is the same"),
    ],
)
def test_each_state_of_a_second_signature_is_told(
    certificate, keys, signers, gfor, other, change, known, state, said
):
    """The first signature is good, and the lab's; ``known`` begins the second's line among the signers."""
    assert gfor("sign", certificate, "--sign", keys / other)[0] == 0
    if change is not None:
        change(certificate)
    lines = [f"{LAB} {line_of(keys, 'ed25519')}"]
    if known is not None:
        lines.append(f"other@example.org {known}{line_of(keys, other.removesuffix('.pem'))}")
    found = seen(gfor, certificate, "--signers", signers(*lines))
    assert found[:2] == (3 if state == "good" else 5, state)
    assert said in found[2]


def test_files_in_folders_of_a_certificate_are_named(certificate, signers, gfor):
    """Of the signature nothing speaks of them; a link is named, and not followed."""
    (certificate / "points").mkdir(exist_ok=True)
    (certificate / "points" / "one.npz").write_bytes(b"1")
    (certificate / "points" / "two.npz").write_bytes(b"2")
    (certificate / "deep" / "er").mkdir(parents=True)
    (certificate / "deep" / "er" / "approval.txt").write_text("approved")
    (certificate / "elsewhere").symlink_to(certificate.parent)
    _, found = verified(gfor, certificate, "--signers", signers())
    in_python = gfor_api.verify(certificate, anew=(), signers=signers())
    assert (in_python.unproved, in_python.holds) == (found["unproved"], True)
    assert in_python.views == found["unproved"][:1]
    count = len(list((certificate / "points").iterdir()))
    (_, *told) = found["unproved"]
    assert told == [
        "deep/er/approval.txt: the certificate does not cover it",
        "elsewhere: the certificate does not cover it",
        f"points/*.npz: {count} files that the certificate does not cover",
    ]


def test_what_does_not_hold_or_was_changed_is_not_signed(certificate, keys, gfor):
    a_detail(certificate)
    code, _, said = gfor("sign", certificate, "--sign", keys / "other")
    assert (code, "does not hold" in " ".join(said.split())) == (2, True)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{key}", "write the signer's name before it"),
        ("lab@example.org ssh-ed25519 AAAA", "no public key"),
        ("lab@example.org", "it has no public key"),
        ("lab@example.org colour=red {key}", "is no option"),
        ('lab@example.org namespaces="file",namespaces="git" {key}', "stands there twice"),
        ("lab@example.org valid-before=soon {key}", "is no time"),
        ("# nobody", "it names nobody"),
    ],
)
def test_a_file_of_signers_that_is_none_is_one_error(certificate, keys, gfor, tmp_path, line, said):
    allowed = tmp_path / "allowed"
    allowed.write_text(line.format(key=line_of(keys, "ed25519")) + "\n", "utf-8")
    code, _, error = gfor("verify", certificate, "--files-only", "--signers", allowed)
    words = " ".join(error.split())
    assert (code, said in words or "ends after" in words) == (2, True), error


def test_openssh_alone_verifies_it(certificate, signers):
    if not ssh_keygen.is_installed():
        pytest.skip("ssh-keygen is not installed")
    words = ["ssh-keygen", "-Y", "verify", "-f", signers(), "-I", LAB]
    words += ["-n", "certificate@gfor-cosim", "-s", certificate / "certificate.pae.sig"]
    content = (certificate / "certificate.pae").read_bytes()
    assert subprocess.run(words, input=content, check=False, capture_output=True).returncode == 0
    assert subprocess.run(words, input=content[1:], check=False, capture_output=True).returncode


def test_a_library_of_envelopes_alone_verifies_it(original, keys, gfor, tmp_path):
    """That of a PEM key, as it is."""
    dsse = pytest.importorskip("securesystemslib.dsse")
    from securesystemslib.exceptions import VerificationError  # noqa: PLC0415
    from securesystemslib.signer import SSlibKey  # noqa: PLC0415

    for kind in ("ed25519", "ecdsa", "rsa"):
        folder = shutil.copytree(original, tmp_path / kind)
        assert gfor("sign", folder, "--sign", keys / f"{kind}.pem")[0] == 0
        envelope = dsse.Envelope.from_dict(envelope_of(folder))
        (keyid,) = envelope.signatures
        key = SSlibKey.from_crypto(_public(keys, kind), keyid)
        assert list(envelope.verify([key], 1)) == [keyid]
        envelope.payload = envelope.payload.replace(b"incomplete", b"passes    ", 1)
        with pytest.raises(VerificationError):
            envelope.verify([key], 1)


def test_a_report_and_an_fmu_are_signed_by_themselves(fmu_path, keys, signers, gfor, tmp_path):
    report, fmu = tmp_path / "check.json", shutil.copy(fmu_path("gfor"), tmp_path / "own.fmu")
    report.write_text('{"tool": "x", "trusted": true, "sha256": {"fmu": "0"}}', "utf-8")
    for file in (report, Path(fmu)):
        assert gfor("sign", file, "--sign", keys / "ed25519")[0] == 0
        code, text, _ = gfor("verify", file, "--json", "--signers", signers())
        assert (code, json.loads(text)["signature"]["state"]) == (0, "good")
        assert gfor("verify", file)[0] == 5  # whose key that is nobody says
        with file.open("ab") as more:
            more.write(b"\n")
        code, text, _ = gfor("verify", file, "--json", "--signers", signers())
        assert (code, json.loads(text)["signature"]["state"]) == (5, "changed")


FORGED_PAGES = {
    "hidden": lambda text: text.replace("</style>", "tr{display:none}</style>"),
    "shown": lambda text: text.replace("</style>", "h1::after{content:' PASSES'}</style>"),
    "scripted": lambda text: text.replace("</script>", ";document.title='passes'</script>"),
    "added": lambda text: text.replace("</main>", "<b>approved</b></main>"),
    "longer": lambda text: text + "<b>approved</b>",
    "shorter": lambda text: text[:-8],
}


@pytest.fixture
def of_rows(tmp_path, tmp_path_factory, fmu_path, gfor):
    """A certificate of a code, computed once for the module."""
    kept = tmp_path_factory.getbasetemp() / "of_rows"
    if not kept.exists():
        words = ["certify", fmu_path("gfor"), "--code", "fingrid", "--no-check", "--workers", 1]
        assert gfor(*words, "--out", kept)[0] in (0, 1, 3)
    return shutil.copytree(kept, tmp_path / "of_rows")


@pytest.mark.slow
def test_the_page_of_a_code_is_made_anew(of_rows, gfor):
    found = json.loads(gfor("verify", of_rows, "--json", "--files-only")[1])
    points = "points/*.npz: 4 files that the certificate does not cover"
    assert (found["holds"], found["unproved"]) == (True, [points]), found["faults"]
    (of_rows / "approval.txt").write_text("approved")
    found = json.loads(gfor("verify", of_rows, "--json", "--files-only")[1])
    assert found["unproved"] == ["approval.txt: the certificate does not cover it", points]


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED_PAGES)
def test_a_page_that_shows_something_else_does_not_hold(of_rows, gfor, name):
    """Unsigned, and with every hash made anew."""
    page = of_rows / "certificate.html"
    text = page.read_text("utf-8")
    assert FORGED_PAGES[name](text) != text
    page.write_text(FORGED_PAGES[name](text), "utf-8")
    edited(of_rows, lambda content: None)
    code, said, _ = gfor("verify", of_rows, "--json", "--files-only")
    assert code == 5
    assert any("is not the page that comes out" in fault for fault in json.loads(said)["faults"])


def a_file_elsewhere(folder):
    (folder.parent / "elsewhere").write_text("x")
    path = folder / "certificate.json"
    content = json.loads(path.read_text("utf-8"))
    content["files"]["../elsewhere"] = sha256_of(folder.parent / "elsewhere")
    del content["seal"]
    write_sealed(content, path)


def a_linked_fmu(folder):
    (folder / "converter.fmu").rename(folder.parent / "out.fmu")
    (folder / "converter.fmu").symlink_to(folder.parent / "out.fmu")


def a_linked_record(folder):
    (folder / "certificate.json").rename(folder.parent / "record.json")
    (folder / "certificate.json").symlink_to(folder.parent / "record.json")


@pytest.mark.parametrize("change", [a_file_elsewhere, a_linked_fmu, a_linked_record])
def test_no_file_leaves_the_folder_and_no_link_is_followed(certificate, gfor, change):
    change(certificate)
    assert gfor("verify", certificate, "--files-only")[0] in (2, 5)
