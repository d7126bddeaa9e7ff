"""An API that stops: streams end so that clients go on, and what it cuts off it answers."""

import json
import socket
import threading
from urllib.parse import urlsplit

import httpx
import redis

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob

HEAD = (
    "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: multipart/form-data; boundary=b\r\n"
    "Content-Length: 100000\r\n\r\n"
    '--b\r\nContent-Disposition: form-data; name="scene"; filename="a.xml"\r\n\r\n<scene'
)


def test_an_upload_that_is_cut_off_is_answered(redis_url: str, store: Blobs) -> None:
    with live_api(redis_url, store, grace_s=1) as url:
        address = urlsplit(url)
        upload = socket.create_connection((str(address.hostname), address.port or 0), timeout=30)
        # Given an upload that will take longer than an API that stops waits for
        upload.sendall(HEAD.encode())
        with httpx.Client(base_url=url) as http:
            assert http.get("/healthz").status_code == 200  # it has come that far
    with upload:
        said = b"".join(iter(lambda: upload.recv(65536), b""))
    # Then it is told to try again
    head, _, body = said.decode().partition("\r\n\r\n")
    assert head.startswith("HTTP/1.1 503 ")
    assert "retry-after: " in head.lower()
    assert json.loads(body)["detail"].startswith("the API stops; try again")


def test_who_watches_goes_on_at_the_next_api(
    redis_url: str, client: redis.Redis, store: Blobs
) -> None:
    # Given one who watches a job, over APIs that come and go at one address
    job = StagedJob(client)
    with live_api(redis_url, store) as url:
        port = int(url.rpartition(":")[2])
        heard: list[str] = []

        def watch() -> None:
            with Client(url, patience_s=60) as plateau:
                heard.extend(event.id for event in plateau.events(job.id))

        watcher = threading.Thread(target=watch)
        watcher.start()
        job.commit(4)
        job.point(100, 50)
    for spp in (200, 300):
        with live_api(redis_url, store, port=port):
            job.commit(4)
            job.point(spp, 40)
    with live_api(redis_url, store, port=port):
        job.end()
        job.finish()
        watcher.join(60)
    # Then each event came once
    assert heard == [event.id for event in Jobs(client).events(job.id)]
