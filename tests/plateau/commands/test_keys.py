"""`plateau keys`, and a service that wants them: made, used, and not seen where they should not."""

import json
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import psutil
import pytest
import redis
import trustme

from plateau.client import ApiError, BadKey, Client, Unreachable
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.model.states import JobState
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.support.processes.commands import Command, plateau, starting
from tests.support.until import until

READY = r"listens at (https?://[\d.]+:\d+)"
SHOWN = re.compile(r"plateau_([0-9a-f]{12})_([0-9a-f]{64})\n")

Say = Callable[..., tuple[str, str]]
Start = Callable[..., Command]


@pytest.fixture
def say(tmp_path: Path) -> Say:
    """Runs a command on the test's data folder: what it says on standard output, and on error."""

    def run(*arguments: str, code: int = 0, **environment: str) -> tuple[str, str]:
        environment = {"PLATEAU_DATA": str(tmp_path / "data"), **environment}
        found, out, err = plateau(*arguments, **environment)
        assert found == code, err
        return out, err

    return run


@pytest.fixture
def ask(say: Say, client: redis.Redis, redis_url: str) -> Say:
    """Runs a command on a Redis that is there."""
    return partial(say, PLATEAU_REDIS_URL=redis_url)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a command on the test's data folder; none outlives the test."""
    yield from starting(partial(Command, folder=tmp_path))


class TestTheCommands:
    def test_make_list_rotate_and_revoke_without_a_service(self, say: Say) -> None:
        # Given a machine on which Plateau never ran
        made, words = say("keys", "create", "me", "--role", "admin", "--open-jobs", "7")
        # Then standard output has the key and nothing else, for KEY=$(plateau keys create me)
        shown = SHOWN.fullmatch(made)
        assert shown is not None
        assert "from now on, every request to the service needs a key" in words
        assert shown[2] not in words
        # And it is listed, but not what it opens with
        [listed] = json.loads(say("keys", "list", "--json")[0])
        assert (listed["id"], listed["name"], listed["role"]) == (shown[1], "me", "admin")
        assert listed["limits"]["open_jobs"] == 7
        assert "sha256" not in listed
        line = say("keys", "list")[0]
        assert line.split("\t")[:3] == [shown[1], "me", "admin"]
        # Another secret, and none
        again = SHOWN.fullmatch(say("keys", "rotate", shown[1])[0])
        assert again is not None
        assert again[1] == shown[1]
        assert again[2] != shown[2]
        assert "that was the last key" in say("keys", "revoke", shown[1])[1]
        assert json.loads(say("keys", "list", "--json")[0])[0]["revoked_at"] is not None

    def test_take_their_limits_from_options(self, ask: Say) -> None:
        options = ("--open-jobs", "9", "--upload-gb", "0.5")
        document = json.loads(ask("keys", "create", "me", "--json", *options)[0])
        assert SHOWN.fullmatch(document["key"] + "\n")
        assert document["limits"] == {
            "upload_bytes": 2**29,
            "open_jobs": 9,
            "scenes_bytes": 50 * 2**30,
        }

    def test_take_a_key_from_a_file_and_print_it_nowhere(self, ask: Say, tmp_path: Path) -> None:
        file, shown = tmp_path / "scaler.key", f"plateau_0123456789ab_{'5' * 64}"
        file.write_text(f"{shown}\n")
        for _ in range(2):
            out, err = ask("keys", "create", "scaler", "--role", "viewer", "--from", str(file))
            assert out == ""
            assert "took key 0123456789ab (scaler) with the role viewer" in err
            assert "5" * 64 not in err
        [listed] = json.loads(ask("keys", "list", "--json")[0])
        assert (listed["id"], listed["role"]) == ("0123456789ab", "viewer")
        file.write_text("")
        assert (
            f"--from: {file} is empty"
            in ask("keys", "create", "scaler", "--from", str(file), code=1)[1]
        )

    def test_take_a_key_from_a_file_once_redis_is_there(self, start: Start, tmp_path: Path) -> None:
        """As in a cluster, which starts all pods at once."""
        file, data = tmp_path / "key", tmp_path / "redis"
        file.write_text(f"plateau_0123456789ab_{'5' * 64}\n")
        url = f"unix://{data}/redis.sock"
        command = start("keys", "create", "me", "--from", str(file), PLATEAU_REDIS_URL=url)
        command.wait_for("trying again for 5 minutes")
        server = EmbeddedRedis(data)
        try:
            assert server.url == url
            until(lambda: command.process.poll() is not None)
        finally:
            server.stop()
        assert command.process.returncode == 0
        assert "took key 0123456789ab (me)" in command.said

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("create", "me", "--role", "king"), "there is no role 'king'; there are viewer, sub"),
            (("create", "me", "--open-jobs", "0"), "--open-jobs: must be at least 1"),
            (("create", "me", "--upload-gb", "0"), "--upload-gb: must be above 0"),
            (("create", ""), "a key's name has 1 to 100 printable characters"),
            (("create", "a\nb"), "a key's name has"),
        ],
    )
    def test_say_what_is_wrong(self, ask: Say, arguments: tuple[str, ...], words: str) -> None:
        out, err = ask("keys", *arguments, code=1)
        assert out == ""
        assert words in err

    def test_know_no_key_that_is_not_there(self, ask: Say) -> None:
        ask("keys", "create", "me")
        for command in ("revoke", "rotate"):
            err = ask("keys", command, "0123456789ab", code=1)[1]
            assert err == (
                "plateau: no key has the id or the name '0123456789ab'; `plateau keys list` shows "
                "the keys\n"
            )

    def test_know_a_key_by_its_name_where_one_alone_has_it(self, ask: Say) -> None:
        for name in ("web page", "twice", "twice"):
            ask("keys", "create", name)
        assert "(web page) has a new secret" in ask("keys", "rotate", "web page")[1]
        assert "(web page) is refused from now on" in ask("keys", "revoke", "web page")[1]
        # Of two that share a name it has to be said which; of one that was revoked, nothing
        ids = [one["id"] for one in json.loads(ask("keys", "list", "--json")[0])][1:]
        err = ask("keys", "revoke", "twice", code=1)[1]
        assert err == f"plateau: 2 keys have the name 'twice': give an id, of {', '.join(ids)}\n"
        ask("keys", "revoke", ids[0])
        assert f"key {ids[1]} (twice)" in ask("keys", "revoke", "twice")[1]

    def test_find_no_farm_where_there_is_none(self, say: Say) -> None:
        assert "there is no data of Plateau in" in say("keys", "list", code=1)[1]


class TestAClient:
    @pytest.fixture
    def key(self, redis_url: str) -> str:
        return ApiKeys(connect(redis_url, 120.0)).create("me", Role.VIEWER, KeyLimits())[1]

    def test_shows_its_key(self, api: str, key: str) -> None:
        with Client(api) as nobody, pytest.raises(ApiError, match="PLATEAU_KEY") as refused:
            list(nobody.all_jobs())
        assert (refused.value.status, refused.value.slug) == (401, "no-key")
        with Client(api, key=key) as viewer:
            assert list(viewer.all_jobs()) == []
            with pytest.raises(ApiError, match="--role submitter") as refused:
                viewer.cancel("0123456789ab")
            assert refused.value.slug == "role-too-low"
            assert key.rpartition("_")[2] not in repr(vars(viewer)) + repr(refused.value)

    @pytest.mark.parametrize("key", ["a b", "a\n", "schlüssel", "x\r\nHost: evil.example"])
    def test_takes_no_key_that_can_be_none(self, api: str, key: str) -> None:
        with pytest.raises(BadKey) as refused:
            Client(api, key=key)
        assert key not in str(refused.value)

    def test_of_the_command_line_takes_it_from_the_environment(
        self, api: str, key: str, say: Say, tmp_path: Path
    ) -> None:
        service = {"PLATEAU_URL": api}
        assert "PLATEAU_KEY" in say("list", code=1, **service)[1]
        assert say("list", **service, PLATEAU_KEY=key)[0] == ""
        file = tmp_path / "key"
        file.write_text(f"{key}\n")
        say("list", **service, PLATEAU_KEY_FILE=str(file))
        refused = say("cancel", "0123456789ab", code=1, **service, PLATEAU_KEY=key)[1]
        assert "--role submitter" in refused

    def test_of_the_command_line_says_which_variable_is_wrong(
        self, api: str, key: str, say: Say, tmp_path: Path
    ) -> None:
        file, both = tmp_path / "key", {"PLATEAU_URL": api, "PLATEAU_KEY": key}
        err = say("list", code=1, **both, PLATEAU_KEY_FILE=str(file))[1]
        assert "set PLATEAU_KEY or PLATEAU_KEY_FILE, not both" in err
        err = say("list", code=1, PLATEAU_URL=api, PLATEAU_KEY_FILE=str(file))[1]
        assert f"PLATEAU_KEY_FILE: {file} cannot be read: No such file" in err
        file.write_text(" \n")
        assert "is empty" in say("list", code=1, PLATEAU_URL=api, PLATEAU_KEY_FILE=str(file))[1]
        err = say("list", code=1, PLATEAU_URL=api, PLATEAU_KEY=f"{key[:-1]} x")[1]
        assert key[:-1] not in err

    def test_doctor_does_not_show_it(self, key: str, redis_url: str, store: Blobs) -> None:
        from plateau.commands.doctor import _without_passwords
        from plateau.farm.process.settings import Settings

        shown = json.dumps(_without_passwords(Settings(key=key)))
        assert key not in shown
        assert "**" in shown


def certified(folder: Path) -> tuple[str, str, str]:
    """A certificate for this machine, its private key, and the authority that nobody else knows."""
    authority = trustme.CA()
    issued = authority.issue_cert("127.0.0.1", "localhost")
    names = [str(folder / name) for name in ("farm.pem", "farm.key", "authority.pem")]
    issued.cert_chain_pems[0].write_to_path(names[0])
    issued.private_key_pem.write_to_path(names[1])
    authority.cert_pem.write_to_path(names[2])
    return names[0], names[1], names[2]


class TestAService:
    def test_says_that_it_is_open_and_is_closed_by_the_first_key(
        self, start: Start, say: Say
    ) -> None:
        up = start("up", "--workers", "0", "--port", "0")
        url = up.wait_for(READY)
        up.wait_for(
            "open to everybody on this machine, and to nobody else: there is no API key yet"
        )
        with Client(url) as client:
            assert list(client.all_jobs()) == []
            # While it runs, and the data folder is its own
            shown = say("keys", "create", "me")[0].strip()
            with pytest.raises(ApiError, match="API key"):
                list(client.all_jobs())
        with Client(url, key=shown) as client:
            assert list(client.all_jobs()) == []
        say("keys", "revoke", shown.split("_")[1])
        with Client(url, key=shown) as client, pytest.raises(ApiError, match="was revoked"):
            list(client.all_jobs())

    def test_listens_elsewhere_with_a_key_only(self, start: Start, say: Say) -> None:
        elsewhere = ("up", "--workers", "0", "--port", "0", "--host", "0.0.0.0")
        refused = start(*elsewhere)
        assert refused.exit_code() == 1
        assert "refusing to listen on '0.0.0.0' without a key" in refused.said
        assert "plateau keys create NAME --role admin" in refused.said
        say("keys", "create", "me")
        up = start(*elsewhere)
        port = up.wait_for(READY).rpartition(":")[2]
        up.wait_for("Every request needs an API key")
        up.wait_for("API keys travel over plain HTTP, which others on the network can read")
        with Client(f"http://127.0.0.1:{port}") as client, pytest.raises(ApiError, match="API key"):
            list(client.all_jobs())

    def test_may_stay_open_on_this_machine(self, start: Start, say: Say) -> None:
        say("keys", "create", "me")
        up = start("up", "--workers", "0", "--port", "0", "--open")
        with Client(up.wait_for(READY)) as client:
            assert list(client.all_jobs()) == []
        up.wait_for("as --open asks")

    def test_says_what_is_wrong_with_a_certificate(
        self, start: Start, say: Say, tmp_path: Path
    ) -> None:
        certificate, private_key, _ = certified(tmp_path)
        both = ("--tls-certificate", certificate, "--tls-key")
        assert "--tls-key together" in say("up", *both[:2], code=2)[1]
        farm = {"PLATEAU_REDIS_URL": "redis://127.0.0.1:1", "PLATEAU_BLOBS": str(tmp_path)}
        api = start("api", "--port", "0", *both, f"{private_key}.old", **farm)
        assert api.exit_code() == 1
        assert "cannot be used: No such file" in api.said
        api = start("api", "--port", "0", *both, certificate, **farm)
        assert api.exit_code() == 1
        assert "cannot be used" in api.said

    def test_keeps_keys_to_itself(
        self, start: Start, say: Say, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A real run over https, with a worker; then everything that it wrote is searched."""
        monkeypatch.setattr("plateau.client.transport._CONNECT_S", 60.0)  # on a busy machine
        # Given a farm that other machines reach, whose own user has a key too
        certificate, private_key, authority = certified(tmp_path)
        admin = say("keys", "create", "admin", "--role", "admin")[0].strip()
        shown = say("keys", "create", "me")[0].strip()
        up = start(
            *("up", "--workers", "1", "--port", "0", "--host", "0.0.0.0"),
            *("--tls-certificate", certificate, "--tls-key", private_key),
            PLATEAU_KEY=admin,
            PLATEAU_LOG_FORMAT="json",
        )
        url = up.wait_for(READY).replace("0.0.0.0", "127.0.0.1")
        assert url.startswith("https://")
        assert "plain HTTP" not in up.said
        for written in (url, url.replace("https", "HTTPS")):
            with pytest.raises(Unreachable, match=r"(?i)certificate"):  # nobody vouches for it
                list(Client(written, key=shown, patience_s=0).all_jobs())
        # If a job is rendered with a key, and others are refused
        with_key = {"PLATEAU_URL": url, "SSL_CERT_FILE": authority, "PLATEAU_KEY": shown}
        small = ("-D", "width=32", "-D", "height=32", "--rule", "fixed", "--spp", "100")
        job_id = say("submit", "scenes:box", *small, **with_key)[0].strip()
        said = [*say("watch", job_id, **with_key)]
        said += say("show", job_id, "--json", **with_key)
        forged = f"{shown[:-64]}{'f' * 64}"
        said += say("list", code=1, **{**with_key, "PLATEAU_KEY": forged})
        said += say("cancel", job_id, code=1, **with_key)
        job = json.loads(said[2])
        assert (job["state"], job["owner_name"]) == (JobState.CONVERGED, "me")
        # No process of the farm was given a key
        for process in up.family():
            # It has just ended, or keeps its environment to itself
            with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
                assert not {"PLATEAU_KEY", "PLATEAU_KEY_FILE"} & set(process.environ())
        up.process.send_signal(signal.SIGTERM)
        assert up.exit_code() == 0
        # Then no secret is in any log, in Redis's own files, in the blobs, or in what was said
        written = [path for path in (tmp_path / "data").rglob("*") if path.is_file()]
        assert any(path.name == "api.log" for path in written)
        everything = "\n".join(said) + up.said
        everything += "".join(path.read_bytes().decode("latin-1") for path in written)
        assert job_id in everything
        for key in (admin, shown, forged):
            assert key.rpartition("_")[2] not in everything
