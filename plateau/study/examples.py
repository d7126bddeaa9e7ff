"""Examples of observer studies in the OpenAPI document."""

from typing import Any, Final

STUDY_ID: Final = "9c1f47be02d8"
OBSERVER: Final[dict[str, Any]] = {
    "name": "o-7f3a",
    "number": 0,
    "screen": {"viewing_distance_cm": 60.0, "pixel_pitch_mm": 0.2715, "gamma_matches": True},
    "joined_at": "2026-11-21T09:30:00.412Z",
    "pixels_per_degree": 38.57,
    "trials": [
        {
            "trial": 0,
            "left": f"/v1/studies/{STUDY_ID}/levels/900.png",
            "right": f"/v1/studies/{STUDY_ID}/reference.png",
            "reference": "right",
        }
    ],
    "answered": [],
}
_JOB_ID: Final = "3b52dbb3a017"
_REFERENCE_ID: Final = "a90d17c4e562"

NEW_STUDY: Final[dict[str, Any]] = {
    "job_id": _JOB_ID,
    "reference_job_id": _REFERENCE_ID,
    "method": "constant",
    "levels": [100, 500, 900, 1300, 1700, 2100, 2500],
}
STUDY: Final[dict[str, Any]] = {
    "id": STUDY_ID,
    "name": "BAR 1",
    "method": "constant",
    "job_id": _JOB_ID,
    "reference_job_id": _REFERENCE_ID,
    "independent": True,
    "levels": [100, 500, 900, 1300, 1700, 2100, 2500],
    "reference_spp": 10_000,
    "slice_spp": 25,
    "exposure_ev": 0.0,
    "width": 512,
    "height": 512,
    "owner": None,
    "created_at": "2026-11-21T09:12:40.115Z",
    "trials": 14,
    "result": {
        "observers": 24,
        "finished": 24,
        "answers": 336,
        "levels": [{"spp": 100, "shown": 48, "seen": 48}, {"spp": 500, "shown": 48, "seen": 46}],
        "a": -0.0018,
        "b": 3.61,
        "thresholds": [
            {"probability": 0.5, "spp": 2005.6, "low_spp": 1794.1, "high_spp": 2288.0},
            {"probability": 0.1, "spp": 3226.2, "low_spp": 2811.0, "high_spp": 3874.4},
        ],
        "suggested_levels": [100, 500, 900, 1300, 1700, 2100, 2500],
    },
    "links": {"self": f"/v1/studies/{STUDY_ID}", "page": f"/studies/{STUDY_ID}"},
}
STUDIES: Final[dict[str, Any]] = {"studies": [STUDY]}
TAKING_PART: Final[dict[str, Any]] = {"screen": OBSERVER["screen"]}
NEW_ANSWER: Final[dict[str, Any]] = {"seen": True, "seconds": 2.4}
ANSWER: Final[dict[str, Any]] = {
    "observer": "o-7f3a",
    "trial": 0,
    "spp": 900,
    "reference": "right",
    "seen": True,
    "seconds": 2.4,
    "at": "2026-11-21T09:31:07.330Z",
}
TRIALS_CSV: Final = (
    "scene,observer,trial,spp,reference,seen,seconds,at,pixels_per_degree,viewing_distance_cm,"
    "gamma_matches\n"
    "BAR 1,o-7f3a,0,900,right,true,2.400,2026-11-21T09:31:07.330000+00:00,38.57,60,true\n"
)
