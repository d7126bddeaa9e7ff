"""The examples in the API's description: a farm with a worker, a scene and a few jobs."""

import hashlib
from typing import Any, Final

JOB_ID: Final = "3b52dbb3a017"
OTHER_ID: Final = "9d01c2aa4be7"
KEY_ID: Final = "c81e5a0f93d2"
EVENT_ID: Final = "1795252332826-0"
IDEMPOTENCY_KEY: Final = "sphere-at-noon"

_WORKER: Final = "vm-23618-bc86"
_CREATED: Final = "2026-11-21T08:12:05.104Z"
_STARTED: Final = "2026-11-21T08:12:06.020Z"
_AT: Final = "2026-11-21T08:12:12.826Z"

#: What `spec` may look like: fields that are left out have their defaults.
SPEC: Final[dict[str, Any]] = {
    "step": 100,
    "slice_spp": 25,
    "max_spp": 2000,
    "rule": {"name": "jod", "target": 9.5},
    "watch": [{"name": "reverse", "window": 5, "epsilon": 0.1}],
    "view": {"exposure_ev": 0, "white_luminance": 200, "pixels_per_degree": 20},
    "parameters": {"width": 256, "height": 256},
}

#: And the same of many jobs.
BATCH_SPEC: Final[dict[str, Any]] = {
    "max_spp": 2000,
    "min_spp": 300,
    "batch": "exposures",
    "parameters": [{"width": 256, "height": 256}, {"width": 320, "height": 256}],
}

#: The smallest scene that can be rendered to something.
SCENE_XML: Final = """<scene version="3.0.0">
  <default name="width" value="256"/>
  <default name="height" value="256"/>
  <integrator type="path"/>
  <sensor type="perspective">
    <film type="hdrfilm">
      <integer name="width" value="$width"/>
      <integer name="height" value="$height"/>
    </film>
  </sensor>
  <shape type="sphere"><bsdf type="diffuse"/></shape>
  <emitter type="constant"/>
</scene>
"""
SCENE_SHA256: Final = hashlib.sha256(SCENE_XML.encode()).hexdigest()

POINT: Final[dict[str, Any]] = {
    "spp": 400,
    "visible_pixels": 1204,
    "visible_fraction": 0.01837158203125,
    "slope": 0.42,
    "estimate_pixels": 96.5,
    "estimate_fraction": 0.0014724731,
    "estimate_low_pixels": 61.0,
    "estimate_high_pixels": 148.0,
    "expected_spp": 1300,
    "non_finite_pixels": 0,
    "at": _AT,
    "rules": {
        "jod": {"value": 9.21, "stop": False},
        "reverse": {"value": 0.42, "stop": False},
    },
}

EVENT_STREAM: Final = (
    "retry: 1000\n\n"
    f"id: {EVENT_ID}\n"
    "event: slice\n"
    f'data: {{"at": "2026-11-21T08:12:12.826000+00:00", "index": 15, "worker": "{_WORKER}"}}\n\n'
)

EVENT: Final[dict[str, Any]] = {
    "id": EVENT_ID,
    "type": "slice",
    "data": {"index": 15, "worker": _WORKER},
    "at": _AT,
}

SLICE: Final[dict[str, Any]] = {
    "index": 15,
    "spp": 25,
    "first_seed": 45,
    "last_seed": 47,
    "sha256": "5d41402abc4b2a76b9719d911017c592ae2f1c6d8e3b4a09f7d6c5b4a3928170",
    "worker": _WORKER,
    "render_s": 0.61,
    "zones": [],
}

LOG_ENTRY: Final[dict[str, Any]] = {
    "at": _AT,
    "slice": 15,
    "worker": _WORKER,
    "what": "committed",
    "cause": None,
    "seconds": 0.61,
    "text": "",
}

WORKER: Final[dict[str, Any]] = {
    "id": _WORKER,
    "host": "vm",
    "pid": 23618,
    "plateau": "0.1.0",
    "variants": ["llvm_ad_rgb", "scalar_rgb"],
    "threads": 8,
    "pool": "night",
    "tags": ["gpu", "highmem"],
    "job": JOB_ID,
    "slice": 16,
    "slices_done": 16,
    "samples_per_s": 2.7e6,
    "core_hours": 0.022,
    "kinds": [
        "mitsuba 3.9.1 (llvm_ad_rgb; libLLVM.so.19.1; AMD EPYC 9R14; bits 3f1c09ab27de)",
    ],
    "machine": {
        "cores": 8,
        "load": 0.93,
        "memory_bytes": 33_567_264_768,
        "memory_used_bytes": 9_123_528_704,
        "disk_bytes": 250_790_436_864,
        "disk_free_bytes": 180_304_302_080,
        "temperature_c": 71.5,
    },
    "last_error": "slice 3: the render process was ended by SIGSEGV while rendering a pass",
    "failures": 1,
    "trouble": None,
    "drained": False,
    "left_out_of": [OTHER_ID],
    "started_at": "2026-11-21T08:00:00Z",
    "seen_at": _AT,
}

SCENE: Final[dict[str, Any]] = {
    "sha256": SCENE_SHA256,
    "name": "sphere.xml",
    "bytes": len(SCENE_XML),
    "width": 256,
    "height": 256,
}

SCENE_FOUND: Final[dict[str, Any]] = {
    **SCENE,
    "kind": "xml",
    "entry": "sphere.xml",
    "files": 1,
    "bytes_unpacked": len(SCENE_XML),
    "sensors": 1,
    "parameters": {"width": "256", "height": "256"},
}

_ROOT: Final = f"/v1/jobs/{JOB_ID}"

PREVIEW: Final[dict[str, Any]] = {
    "spp": 100,
    "link": f"{_ROOT}/previews/100.png",
}

JOB: Final[dict[str, Any]] = {
    "id": JOB_ID,
    "name": "sphere.xml",
    "title": "sphere.xml width=256 height=256",
    "owner": KEY_ID,
    "owner_name": "nightly",
    "state": "rendering",
    "outcome": "rendering",
    "reason": "a worker took its first slice",
    "spec": SPEC,
    "scene_sha256": SCENE_SHA256,
    "variant": "llvm_ad_rgb",
    "width": 256,
    "height": 256,
    "spp": 400,
    "image_spp": 400,
    "committed_spp": 425,
    "points": 4,
    "visible_pixels": 1204,
    "visible_fraction": 0.01837158203125,
    "slope": 0.42,
    "estimate_pixels": 96.5,
    "estimate_fraction": 0.0014724731,
    "non_finite_pixels": 0,
    "expected_spp": 1300,
    "expected_s": 15.3,
    "samples_saved": 0,
    "saved_fraction": 0.0,
    "machine_s": 10.4,
    "core_hours": 0.023111111,
    "saved_core_hours": 0.0,
    "wasted_s": 0.3,
    "second_tries": 1,
    "waits_for": None,
    "queue_place": None,
    "time_left": "about 15 s left",
    "sampled": "by zones",
    "seen": "on a desk monitor at 200 %",
    "seen_density": 20.0,
    "fitting_workers": 3,
    "created_at": _CREATED,
    "started_at": _STARTED,
    "links": {
        "self": _ROOT,
        "curve": f"{_ROOT}/curve",
        "events": f"{_ROOT}/events",
        "image_png": f"{_ROOT}/image.png",
        "cancel": f"{_ROOT}/cancel",
        "again": f"{_ROOT}/again",
    },
}

NOTICE_MESSAGE: Final[dict[str, Any]] = {
    "type": "job.finished",
    "timestamp": _AT,
    "data": {
        "job": {
            **JOB,
            "state": "converged",
            "outcome": "converged",
            "ended_by": "rule",
            "ended_at": _AT,
            "finished_at": _AT,
        }
    },
}

METRICS: Final = (
    "# HELP plateau_jobs Jobs that have not ended, by state.\n"
    "# TYPE plateau_jobs gauge\n"
    'plateau_jobs{state="rendering"} 1.0\n'
)
