"""Where Redis is, by URL: what can be meant is found, and no password is ever shown."""

from pathlib import Path

import pytest

from plateau.farm.redis.link import connect
from plateau.farm.redis.url import (
    BadRedisUrl,
    check,
    sentinels_of,
    with_parameters,
    with_password,
    with_user,
    without_password,
)

SECRET = "s3cret/p@ss:word"
WRITTEN = "s3cret%2Fp%40ss%3Aword"

SENTINELS = "redis+sentinel://plateau-worker:pw@a:26379,b,[::1]:5000/mymaster/2"


def test_sentinels_and_the_master_are_named() -> None:
    found = sentinels_of(SENTINELS)
    assert found is not None
    assert found.addresses == (("a", 26379), ("b", 26379), ("::1", 5000))
    assert found.service == "mymaster"
    assert found.options == {"username": "plateau-worker", "password": "pw", "db": 2}
    assert found.own_options == {}


def test_tls_is_for_the_sentinels_too_and_their_password_for_them_alone(tmp_path: Path) -> None:
    ca = tmp_path / "ca.pem"
    ca.touch()
    url = f"rediss+sentinel://:pw@a/mymaster?sentinel_password=other&ssl_ca_certs={ca}"
    found = sentinels_of(url)
    assert found is not None
    tls = {"ssl": True, "ssl_ca_certs": str(ca)}
    assert found.options == {"password": "pw", **tls}
    assert found.own_options == {"password": "other", **tls}


@pytest.mark.parametrize("url", ["redis://host", "rediss://u:p@host:1/0", "unix:///run/redis.sock"])
def test_a_redis_itself_has_no_sentinels(url: str) -> None:
    assert sentinels_of(url) is None
    check(url)


BAD = [
    *("", "host:6379", "http://host", "redis:host"),
    *("redis://", "redis://u:pw@", f"redis://u:{SECRET}@host", "redis://u:pw@host:port"),
    "rediss://u:a?b@host",
    "redis://u:a#b@host",
    "redis://u:pw@[::1",
    *("redis+sentinel://a,b", "redis+sentinel://a/", "redis+sentinel://a/my master"),
    *("redis+sentinel://a/m/x", "redis+sentinel://a,,b/m", "redis+sentinel://a:x/m"),
    *("redis+sentinel://a:65536/m", "redis+sentinel://a:٣/m", "redis+sentinel://a\n/m"),
    *("redis+sentinel://[::1/m", "redis+sentinel://[nowhere]/m", "redis+sentinel://::1/m"),
    f"redis+sentinel://u:{SECRET}@a/m",
    "redis://host?socket_timeout=soon",
    "rediss://host?ssl_ca_certs=/nowhere.pem",
]


@pytest.mark.parametrize("url", BAD)
def test_what_cannot_be_meant_is_refused_without_a_word_of_a_password(url: str) -> None:
    for look in (check, connect):
        with pytest.raises(BadRedisUrl) as refusal:
            look(url)
        told = f"{refusal.value}{refusal.value.__cause__ or ''}"
        assert not any(part in told for part in ("s3cret", "p@ss", "word:", "pw", "port'"))


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("redis://host:6379/0", "redis://host:6379/0"),
        ("redis://:pw@host", "redis://:***@host"),
        ("rediss://worker:pw@host", "rediss://worker:***@host"),
        (f"redis://worker:{SECRET}@host", "redis://worker:***@host"),
        ("redis+sentinel://w:pw@a,b/m?sentinel_password=pw2&ssl_ca_certs=/ca", None),
        ("unix:///run/redis.sock?password=pw", "unix:///run/redis.sock?password=***"),
    ],
)
def test_a_url_is_shown_without_its_passwords(url: str, shown: str | None) -> None:
    shown = shown or "redis+sentinel://w:***@a,b/m?sentinel_password=***&ssl_ca_certs=/ca"
    assert without_password(url) == shown


def test_a_password_comes_into_a_url_whatever_it_is() -> None:
    url = with_password("rediss://worker@host:6379/0", SECRET)
    assert url == f"rediss://worker:{WRITTEN}@host:6379/0"
    assert connect(url).connection_pool.connection_kwargs["password"] == SECRET
    # The same once more is no contradiction; another one is
    assert with_password(url, SECRET) == url
    with pytest.raises(BadRedisUrl, match="leave one"):
        with_password(url, "another")


def test_a_user_comes_into_a_url() -> None:
    assert with_user("rediss://host/0", "plateau-worker") == "rediss://plateau-worker@host/0"
    assert with_user("redis+sentinel://:pw@a,b/m", "w") == "redis+sentinel://w:pw@a,b/m"
    assert with_user("redis://w@host", "w") == "redis://w@host"
    with pytest.raises(BadRedisUrl, match="leave one"):
        with_user("redis://other@host", "w")


def test_parameters_of_the_url_itself_count_for_more() -> None:
    url = with_parameters("rediss://host/0?ssl_ca_certs=/mine", {"ssl_ca_certs": "/c", "x": "a/b"})
    assert url == "rediss://host/0?ssl_ca_certs=/mine&x=a/b"
    assert with_parameters("unix:///run/redis.sock", {"db": "1"}) == "unix:///run/redis.sock?db=1"
