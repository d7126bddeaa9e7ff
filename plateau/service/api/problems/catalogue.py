"""Every problem that the API answers with: its type, and the sentences that tell of it.

A site names the problem and passes the fields of its sentence. The API's description and the table
in docs/api.md are made from this.
"""

import logging
from typing import Any, Final

from plateau.farm.model.errors import (
    BatchNotFound,
    JobNotFound,
    TooManyJobs,
    TooManyNeeds,
    UnreadableJob,
    WorkerNotFound,
)
from plateau.farm.wire import examples
from plateau.service.api.problems.problem import MEDIA_TYPE, Problem, ProblemType

#: The status for a client that has disconnected; nobody reads it, but the metrics count it.
CLIENT_GONE: Final = 499

_log = logging.getLogger(__name__)

# fmt: off

#: What the fields of the examples are, where a type does not say otherwise.
_EXAMPLE: Final[dict[str, object]] = {
    "job": examples.JOB_ID, "job_id": examples.JOB_ID, "clause": "is converged",
    "state": "converged", "host": "farm.example", "origin": "https://example.org",
    "path": "/problems/none", "key": "nightly", "needed": "submitter", "role": "viewer",
    "batch": "exposures", "spp": 130, "index": 15,
    "seconds": 1,
    "stored_bytes": 53_000_000_000, "limit_bytes": 53_687_091_200, "size": 900_000_000,
    "media_type": "application/json", "sha256": examples.SCENE_SHA256,
    "name": f"jobs/{examples.JOB_ID}/results/0000400-7-final/image.exr",
}
_CLOSE: Final = {"Connection": "close"}
_EVENTS: Final = "GET /v1/jobs/{job}/events announces it"

# Requests that cannot be read.

MALFORMED_REQUEST: Final = ProblemType(
    "malformed-request", 400, "Bad request",
    "the body is not JSON", "send one JSON value, in UTF-8, as /docs shows it")
NOT_HTTP: Final = MALFORMED_REQUEST.case(
    "the request is not HTTP/1.1 by RFC 9112, or its head has more than 64 KiB",
    "check the address (http:// or https://), and send fewer or shorter headers",
    headers=_CLOSE)
TWO_LENGTHS: Final = MALFORMED_REQUEST.case(
    "the request does not say where its body ends",
    "send Content-Length, or with HTTP/1.1 Transfer-Encoding: chunked, and never both",
    headers=_CLOSE)
BROKEN_FORM: Final = MALFORMED_REQUEST.case(
    "the form cannot be read: {error}",
    "send a scene as a file, or the scene_sha256 of a stored one, and a spec, as curl -F "
    "scene=@FILE -F 'spec={{}}' does")

# Who may ask.

FOREIGN_HOST: Final = ProblemType(
    "foreign-host", 403, "Host not allowed",
    "the request is addressed to {host!r}",
    "without API keys, this service answers its own machine only, as localhost, 127.0.0.1 or "
    "[::1]; once `plateau keys create NAME` has made a key, it answers under any name")
THROUGH_A_PROXY: Final = FOREIGN_HOST.case("the request came through a proxy")
FOREIGN_ORIGIN: Final = ProblemType(
    "foreign-origin", 403, "Origin not allowed",
    "a page of {origin!r} made this request", "only the API's own pages may")
FOREIGN_SITE: Final = FOREIGN_ORIGIN.case(
    "a page of another web site made this request (Sec-Fetch-Site: {site})",
    "only the API's own pages may; where you followed a link, enter its address yourself")
NO_KEY: Final = ProblemType(
    "no-key", 401, "API key required",
    "this service needs an API key, in the header Authorization: Bearer KEY",
    "plateau's commands take it from PLATEAU_KEY or PLATEAU_KEY_FILE, its Python client as "
    "Client(key=…), and `plateau keys create NAME`, where the service runs, makes one",
    headers={"WWW-Authenticate": 'Bearer realm="plateau"'})
BAD_KEY: Final = ProblemType(
    "bad-key", 401, "Invalid API key",
    "the service does not know this key, or it was revoked",
    "check PLATEAU_KEY, or ask who runs the service for another: `plateau keys create NAME` makes "
    "one",
    headers={"WWW-Authenticate": 'Bearer realm="plateau", error="invalid_token"'})
ROLE_TOO_LOW: Final = ProblemType(
    "role-too-low", 403, "Insufficient role",
    "this needs a key with the role {needed}, and the key {key!r} has the role {role}",
    "`plateau keys create NAME --role {needed}` makes one",
    members=("role", "needed"),
    headers={"WWW-Authenticate": 'Bearer realm="plateau", error="insufficient_scope"'})
WORKERS_ARE_SHARED: Final = ROLE_TOO_LOW.case(
    "workers serve every key, so only one with the role {needed} may steer them, and the key "
    "{key!r} has the role {role}",
    "",
    headers={})
NOT_YOUR_JOB: Final = ProblemType(
    "not-your-job", 403, "Job of another key",
    "job {job_id} belongs to another key",
    "only that key, or one with the role admin, may change it",
    members=("job_id",))
JOB_OF_NO_KEY: Final = NOT_YOUR_JOB.case(
    "job {job_id} was made without a key", "only a key with the role admin may change it")

# What is not there.

UNKNOWN_PATH: Final = ProblemType(
    "unknown-path", 404, "Not found",
    "nothing is served at {path}", "/docs lists what is")
SLASH_AT_END: Final = UNKNOWN_PATH.case(
    UNKNOWN_PATH.detail, "/docs lists what is, without a slash at its end")
NO_PAGE_FILE: Final = UNKNOWN_PATH.case("the page has no file {name!r}", "")
NO_SUCH_PROBLEM: Final = UNKNOWN_PATH.case("there is no problem type {slug!r}", "")
UNKNOWN_JOB: Final = ProblemType(
    "unknown-job", 404, "Unknown job",
    "{error}",
    "GET /v1/jobs lists those there are",
    example={"error": JobNotFound(examples.JOB_ID)})
UNKNOWN_WORKER: Final = ProblemType(
    "unknown-worker", 404, "Unknown worker",
    "{error}",
    "GET /v1/workers lists those there are",
    example={"error": WorkerNotFound(examples.WORKER["id"])})
UNKNOWN_BATCH: Final = ProblemType(
    "unknown-batch", 404, "Unknown batch",
    "{error}",
    "GET /v1/batches lists those there are",
    example={"error": BatchNotFound("exposures")})
NO_SHOT: Final = ProblemType(
    "no-shot", 404, "Batch is no shot",
    "the batch {batch!r} is no shot: submit its frames with `shot`")
NO_IMAGE_YET: Final = ProblemType(
    "no-image-yet", 404, "Image not available",
    "job {job} is {state}",
    f"its first image comes a moment after its first samples, and {_EVENTS}",
    members=("state",),
    example={"state": "queued"})
NO_IMAGE_LEFT: Final = NO_IMAGE_YET.case("job {job} {clause} and left no image: {reason}", "")
_AN_IMAGE: Final = "job {job} {clause} and has an image of {image_spp} spp, "
_FIRST_POINT: Final = "the first point of its curve, at {first_spp} spp"
NO_DIFFERENCE_YET: Final = NO_IMAGE_YET.case(
    f"{_AN_IMAGE}but no difference map yet: that comes with {_FIRST_POINT}, and {_EVENTS}", "")
NO_DIFFERENCE: Final = NO_IMAGE_YET.case(
    f"{_AN_IMAGE}but no difference map: it ended before {_FIRST_POINT}: {{reason}}", "")
NO_QUALITY: Final = NO_IMAGE_YET.case(
    "no rule of job {job} goes by ColorVideoVDP",
    "judged again with --watch jod, its curve has the quality in JOD")
NOISE_UNKNOWN: Final = NO_IMAGE_YET.case(
    f"{_AN_IMAGE}whose noise nobody knows yet: that takes two slices, and an image without broken "
    "pixels",
    "")
NO_PICTURES: Final = NO_IMAGE_YET.case(
    "job {job} was to make no pictures (`pictures` of its spec)", "image.exr has its image")
NO_ZONES: Final = NO_IMAGE_YET.case(
    "job {job} is allocated by frame: all its pixels have the same samples", "")
ALL_FINITE: Final = NO_IMAGE_YET.case(f"{_AN_IMAGE}of which no pixel is NaN or infinite", "")
SHOT_NOT_JUDGED: Final = NO_IMAGE_YET.case(
    "the shot of {batch!r} was not judged yet: that takes all of its frames", "")
NO_FRAME_YET: Final = NO_IMAGE_YET.case("no frame of the shot of {batch!r} has an image yet", "")
UNKNOWN_POINT: Final = ProblemType(
    "unknown-point", 404, "No picture of this point",
    "job {job} keeps no picture of {spp} spp",
    "GET /v1/jobs/{job}/previews lists the pictures there are")
UNKNOWN_SLICE: Final = ProblemType(
    "unknown-slice", 404, "Slice not stored",
    "slice {index} of job {job} is not stored", "slices stay where the job's spec says keep_slices")
BEYOND_THE_PLAN: Final = UNKNOWN_SLICE.case(
    "job {job} has no slice {index}: so far it has {slices}", "")
BEYOND_THE_CAP: Final = UNKNOWN_SLICE.case(
    "job {job} has no slice {index}: at its cap it has {slices}", "")
METHOD_NOT_ALLOWED: Final = ProblemType(
    "method-not-allowed", 405, "Method not allowed",
    "{path} does not take {method}",
    "/docs says what it takes",
    example={"path": "/v1/jobs", "method": "DELETE"})

# What a job or a farm does not allow.

CANNOT_CANCEL: Final = ProblemType(
    "cannot-cancel", 409, "Job already ended",
    "job {job} {clause}",
    "only a job that has not ended can be cancelled",
    members=("state", "story"))
CANNOT_PAUSE: Final = ProblemType(
    "cannot-pause", 409, "Job not rendering",
    "job {job} {clause}",
    "only a job that is rendering can be paused; a queued one can have a lower priority",
    members=("state", "story"),
    example={"clause": "is queued", "state": "queued"})
CANNOT_RESUME: Final = ProblemType(
    "cannot-resume", 409, "Job not paused",
    "job {job} {clause}", "only a paused job can be resumed", members=("state", "story"))
TOO_MANY_NEEDS: Final = ProblemType(
    "too-many-needs", 409, "Too many combinations of pools and tags",
    "{error}",
    "wait for some to end, or ask for a combination that others have",
    example={"error": TooManyNeeds(64)})
JOB_ENDED: Final = ProblemType(
    "job-ended", 409, "Job already ended",
    "job {job} {clause}",
    "only a job that has not ended can be changed",
    members=("state", "story"))
JOB_NOT_ENDED: Final = ProblemType(
    "job-not-ended", 409, "Job not ended",
    "job {job} is {state}",
    "only a job that has ended can be deleted or rendered again: cancel it first",
    members=("state",),
    example={"state": "rendering"})
RESULTS_BEING_WRITTEN: Final = JOB_NOT_ENDED.case(
    "the results of job {job} are being written: try again in a moment", "")
TOO_MANY_SCENES: Final = ProblemType(
    "too-many-scenes", 403, "Scene storage quota exceeded",
    "the key {key!r} has stored {stored_bytes:,} bytes of scenes and may store {limit_bytes:,}; "
    "this one has {size:,}",
    "ask who runs the service to remove unused ones (`plateau gc --scenes-unused-for DAYS`)",
    members=("stored_bytes", "limit_bytes"))

# What was sent.

UPLOAD_TOO_LARGE: Final = ProblemType(
    "upload-too-large", 413, "Upload too large",
    "the request has more than {limit_bytes:,} bytes",
    "PLATEAU_MAX_UPLOAD_GB sets the limit",
    members=("limit_bytes",),
    headers=_CLOSE)
LARGE_FOR_THE_KEY: Final = UPLOAD_TOO_LARGE.case(
    "the request has more than {limit_bytes:,} bytes, the limit of the key {key!r}", "")
LARGE_CHANGE: Final = UPLOAD_TOO_LARGE.case(UPLOAD_TOO_LARGE.detail, "")
NOT_MULTIPART: Final = ProblemType(
    "not-multipart", 415, "Unsupported media type",
    "the body is {media_type}",
    "send multipart/form-data with the parts scene and spec, as curl -F scene=@scene.zip -F "
    "'spec={{}}' does")
INVALID_REQUEST: Final = ProblemType(
    "invalid-request", 422, "Invalid request",
    "{said}", members=("errors",), example={"said": "limit: must be at most 200"})
UNKNOWN_PARAMETERS: Final = INVALID_REQUEST.case(
    "{first}: there is no such parameter; there are {known}")
BAD_IDEMPOTENCY_KEY: Final = INVALID_REQUEST.of(
    "Idempotency-Key", "must be 1 to 255 printable ASCII characters without spaces")
UNKNOWN_PART: Final = INVALID_REQUEST.of(
    "{part}", "there is no part {part!r}; the parts are scene, scene_path, scene_sha256 and spec")
SEVERAL_SCENES: Final = INVALID_REQUEST.of(
    "{part}", "send one of scene, scene_path and scene_sha256")
BAD_SCENE_PATH: Final = INVALID_REQUEST.of(
    "scene_path", "must be text of up to {most} printable characters, as {{assets}}/s.xml")
SCENE_NOT_A_FILE: Final = INVALID_REQUEST.of(
    "scene", "must be a file: curl takes it as -F scene=@FILE, with the @")
BAD_SHA256: Final = INVALID_REQUEST.of("scene_sha256", "must be 64 lower-case hexadecimal digits")
NO_SCENE_ROOTS: Final = INVALID_REQUEST.of(
    "scene_path", "this service has no scene roots (PLATEAU_SCENE_ROOTS); send the scene as a file")
UNTIL_BEFORE_SINCE: Final = INVALID_REQUEST.of(
    "until", "it has to be later than since, and {until} is not later than {since}")
NO_JOBS_NAMED: Final = INVALID_REQUEST.of("job", "name a job or a batch")
NO_TIME: Final = INVALID_REQUEST.of("{name}", "{text} is no time: {error}")
INVALID_SPEC: Final = ProblemType(
    "invalid-spec", 422, "Invalid job spec",
    "{said}", members=("errors",), example={"said": "spec.max_spp: must be at least 1"})
CANNOT_FOLLOW: Final = INVALID_SPEC.of("spec.after", "{error}")
UNFIT_FILM: Final = INVALID_SPEC.of("{field}", "{error}")
SIZE_UNKNOWN: Final = INVALID_SPEC.of(
    "{field}",
    "the frames of a shot have one size, which the renderer alone knows of this scene: set the "
    "parameters width and height")
SMALL_FRAME: Final = INVALID_SPEC.of(
    "{field}",
    "makes a film of {width}×{height}: the frames of a shot have at least {least}×{least} pixels")
SIZES_DIFFER: Final = INVALID_SPEC.of(
    "{field}",
    "makes a film of {width}×{height}, and {first} one of {first_width}×{first_height}: the frames "
    "of a shot have one size")
HIDDEN_URL: Final = INVALID_SPEC.of(
    "spec.notice.url", "is what others are shown of it: name the whole URL")
REFUSED_URL: Final = INVALID_SPEC.of("spec.notice.url", "{error}")
NO_SECRET: Final = INVALID_SPEC.of(
    "spec.notice.secret",
    "must sign what is sent to the URL: `echo whsec_$(openssl rand -base64 32)` makes one")
UNKNOWN_NOTICE_TARGET: Final = INVALID_SPEC.of("spec.notice.targets", "{error}")
TOO_MANY_TAGS: Final = INVALID_SPEC.of(
    "spec.requires", "has {tags} tags, with those of the scene's roots; {most} are allowed")
FOREIGN_VARIANT: Final = INVALID_SPEC.of("spec.variant", "{error}")
SLOW_TO_CHECK: Final = INVALID_SPEC.of(
    "spec.parameters",
    "with {entries} entries the scene took {seconds:g} s to check; send fewer at once, each time "
    "with the same batch")
SHOT_OF_ONE: Final = INVALID_SPEC.of(
    "spec.shot", "is of a batch: give `parameters` as a list with an entry for each frame")
INVISIBLE_NAME: Final = INVALID_SPEC.of(
    "spec.{field}", "must be a name without invisible characters and line ends")
DOTTED_BATCH: Final = INVALID_SPEC.of("spec.batch", "must be another name than . and ..")
NO_SCENE: Final = ProblemType(
    "no-scene", 422, "Missing scene",
    "send a scene or a zip of one as the part scene, the name of a scene in a scene root as the "
    "part scene_path, or the SHA-256 of a stored scene as the part scene_sha256")
UNKNOWN_SCENE: Final = ProblemType(
    "unknown-scene", 422, "Unknown scene",
    "no scene {sha256} is stored here", "send the file itself as the part scene")
DAMAGED_SCENE: Final = UNKNOWN_SCENE.case(
    "the copy of scene {sha256} that is stored here is damaged",
    "remove the blob {blob} and send the file itself as the part scene")
BROKEN_SCENE: Final = ProblemType(
    "broken-scene", 422, "Invalid scene",
    "{error}",
    members=("code", "file", "line", "errors"),
    example={"error": "scene.xml, line 7: the file meshes/wall.ply is not in the bundle"})
BROKEN_WITH: Final = BROKEN_SCENE.case("with {field}: {error}")
UNREADABLE_SCENE_FILES: Final = BROKEN_SCENE.case("the scene's files cannot be read: {error}")
MADE_UP_LIST: Final = BROKEN_SCENE.case(
    "the upload has a {name}, which the service alone makes",
    "name a scene in a scene root as the part scene_path")
SCENE_TOO_LARGE: Final = UPLOAD_TOO_LARGE.case(
    BROKEN_SCENE.detail, "", members=BROKEN_SCENE.members, headers={})
SCENE_TOO_LARGE_WITH: Final = SCENE_TOO_LARGE.case(BROKEN_WITH.detail)
KEY_REUSED: Final = ProblemType(
    "idempotency-key-reused", 422, "Idempotency key reused",
    "the Idempotency-Key {key!r} made job {job_id} from another scene or spec",
    "use a new key for a new request",
    members=("job_id",),
    example={"key": examples.IDEMPOTENCY_KEY})

# Too much, and trouble within.

TOO_MANY_JOBS: Final = ProblemType(
    "too-many-jobs", 429, "Too many open jobs",
    "{error}",
    "wait for one to end, or cancel one",
    members=("open_jobs", "limit"),
    example={"error": TooManyJobs(1000, 1000)})
INTERNAL_ERROR: Final = ProblemType(
    "internal-error", 500, "Internal server error",
    "Plateau met an error that it did not expect", "the API's log has the details")
UNREADABLE_JOB: Final = ProblemType(
    "unreadable-job", 500, "Unreadable job",
    "{error}",
    example={
        "error": UnreadableJob(examples.JOB_ID, ValueError("'resting' is not a valid JobState"))
    })
SPOILED_FILE: Final = ProblemType(
    "spoiled-file", 500, "Stored file damaged",
    "what was stored as {name} is damaged or lost",
    "restore that blob from a backup, or render the scene again")
BUSY: Final = ProblemType(
    "busy", 503, "Service busy",
    "many scenes are being checked already", "try again in 2 s", headers={"Retry-After": "2"})
TOO_MANY_CONNECTIONS: Final = BUSY.case(
    "this API has as many connections as it may have", headers={**BUSY.headers, **_CLOSE})
STORE_UNAVAILABLE: Final = ProblemType(
    "store-unavailable", 503, "Redis or blob store unavailable",
    "{error}",
    "try again shortly",
    headers={"Retry-After": "2"},
    example={"error": "Redis cannot be reached"})
API_STOPS: Final = STORE_UNAVAILABLE.case("the API stops")
UPLOAD_NOT_KEPT: Final = STORE_UNAVAILABLE.case(
    "the upload could not be kept: {error}", "", headers={})
NO_ROOM_FOR_UPLOADS: Final = UPLOAD_NOT_KEPT.case(
    "the disk on which this API keeps uploads is nearly full", "its operator has to free some")

# fmt: on

#: Every type, by its slug.
TYPES: Final[dict[str, ProblemType]] = {}
for _one in tuple(globals().values()):
    if isinstance(_one, ProblemType):
        TYPES.setdefault(_one.slug, _one)


def of_extension(*kinds: ProblemType) -> None:
    """List the types of an extension's with all others."""
    TYPES.update((kind.slug, kind) for kind in kinds)


def of_status(status: int) -> ProblemType:
    """The type for a bare status of the framework's."""
    known = {400: MALFORMED_REQUEST, 404: UNKNOWN_PATH, 405: METHOD_NOT_ALLOWED}
    words = "the request to {path} cannot be answered as it is", "/docs says what to send"
    return known.get(status) or ProblemType("http-error", status, "The request failed", *words)


_SCHEMA: Final = {"$ref": "#/components/schemas/ProblemDetails"}


def documented(*kinds: ProblemType, store: bool = True) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI ``responses`` of a route that may answer with these problems.

    `store` adds the problem of a route that uses Redis or the blob store, which may be away.
    """
    statuses: dict[int | str, dict[str, Any]] = {}
    for kind in (*kinds, STORE_UNAVAILABLE) if store else kinds:
        line = f"`{kind.uri}`: {kind.title}"
        known = statuses.setdefault(
            kind.status, {"content": {MEDIA_TYPE: {"schema": _SCHEMA, "examples": {}}}}
        )
        known["description"] = "; ".join(filter(None, (known.get("description"), line)))
        value = Problem(kind, **{**_EXAMPLE, **kind.example}).body(f"/v1/jobs/{examples.JOB_ID}")
        known["content"][MEDIA_TYPE]["examples"][kind.slug] = {"value": value}
    return statuses


def unavailable(method: str, path: str, kind: ProblemType, error: object = None) -> Problem:
    """The problem of a request while Redis or the blob store is away; it is logged too."""
    problem = Problem(kind, error=error)
    _log.warning("%s %s: %s", method, path, kind.detail.format(error=error))
    return problem
