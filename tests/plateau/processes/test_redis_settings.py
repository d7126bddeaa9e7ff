"""What is said of Redis beside its URL: put together, and never shown; and the users' ACL file."""

import hashlib
import stat
from pathlib import Path

import pytest
import trustme
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.redis.acl import acl_file, rules
from plateau.processes.read_settings import (
    REDIS_VARIABLES,
    BadSetting,
    farm_settings,
    read_settings,
)

PASSWORD = "s3cret/p@ss:word"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "password"
    made.write_text(f"{PASSWORD}\n")
    return made


@pytest.fixture(autouse=True)
def _nothing_set(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PLATEAU_REDIS_URL", *REDIS_VARIABLES):
        monkeypatch.delenv(name, raising=False)


def url(monkeypatch: pytest.MonkeyPatch, **settings: object) -> str | None:
    for name, value in settings.items():
        monkeypatch.setenv(f"PLATEAU_REDIS_{name.upper()}", str(value))
    return farm_settings().redis_url


def test_user_password_and_certificates_come_into_the_url(
    monkeypatch: pytest.MonkeyPatch, file: Path, tmp_path: Path
) -> None:
    ca = tmp_path / "ca.pem"
    trustme.CA().cert_pem.write_to_path(ca)
    whole = url(
        monkeypatch,
        url="rediss+sentinel://a,b/farm/0",
        user="plateau-worker",
        password_file=file,
        ca=ca,
        sentinel_password_file=file,
    )
    assert whole == (
        "rediss+sentinel://plateau-worker:s3cret%2Fp%40ss%3Aword@a,b/farm/0"
        f"?ssl_ca_certs={ca}&sentinel_password=s3cret/p%40ss%3Aword"
    )
    # And of a process that is handed all that, the settings themselves say nothing
    assert PASSWORD not in repr(farm_settings())
    assert "s3cret" not in repr(farm_settings())


def test_without_a_url_nothing_of_it_matters(monkeypatch: pytest.MonkeyPatch, file: Path) -> None:
    assert url(monkeypatch, password_file=file, user="plateau-worker") is None


def test_who_only_talks_to_the_service_reads_no_password(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PLATEAU_REDIS_URL", "rediss://host")
    monkeypatch.setenv("PLATEAU_REDIS_PASSWORD_FILE", str(tmp_path / "not mine"))
    assert read_settings().redis_url == "rediss://host"


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"url": "redis://host", "ca": __file__}, "must begin with rediss"),
        ({"url": "rediss://host", "ca": "/nowhere"}, "there is no file /nowhere"),
        ({"url": "rediss://host", "cert": __file__}, "together, or neither"),
        ({"url": "rediss://u:other@host", "password_file": True}, "leave one of the two out"),
        ({"url": "rediss://u@host", "user": "other"}, "leave one of the two out"),
        ({"url": "rediss://host", "password_file": "/nowhere"}, "cannot be read: No such file"),
        ({"url": f"redis://u:{PASSWORD}@host"}, "PLATEAU_REDIS_URL: cannot be read"),
        ({"url": "http://host"}, "PLATEAU_REDIS_URL: must begin with"),
    ],
)
def test_what_does_not_fit_together_is_named_without_a_password(
    monkeypatch: pytest.MonkeyPatch, file: Path, settings: dict[str, object], why: str
) -> None:
    given = {name: file if value is True else value for name, value in settings.items()}
    with pytest.raises(BadSetting) as refusal:
        url(monkeypatch, **given)
    assert why in str(refusal.value)
    assert not any(part in str(refusal.value) for part in ("s3cret", "p@ss", "other@"))


def test_passwords_are_made_once_and_only_their_hashes_are_printed(tmp_path: Path) -> None:
    folder = tmp_path / "passwords"
    first = CliRunner().invoke(app, ["redis-acl", "--passwords", str(folder)])
    assert first.exit_code == 0, first.stderr
    again = CliRunner().invoke(app, ["redis-acl", "--passwords", str(folder)])
    assert (again.stdout, again.stderr) == (first.stdout, "")
    assert {file.name.removesuffix(".password") for file in folder.iterdir()} == set(rules())
    for file in folder.iterdir():
        password = file.read_text().strip()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        assert len(password) == 64
        assert password not in first.stdout
        assert f"#{hashlib.sha256(password.encode()).hexdigest()} " in first.stdout


def test_rights_to_read_alone_are_for_a_redis_that_knows_them() -> None:
    old = CliRunner().invoke(app, ["redis-acl", "--redis", "6.2.14"])
    assert old.stdout == acl_file({}, (6, 2))
    assert "%R~" not in old.stdout
    assert "%R~plateau:schema" in CliRunner().invoke(app, ["redis-acl"]).stdout
    for bad in ("6.0", "seven"):
        refused = CliRunner().invoke(app, ["redis-acl", "--redis", bad])
        assert refused.exit_code == 1
        assert "is not a version of Redis from 6.2 on" in refused.stderr
