"""The fields of a point of the curve, as `plateau.farm.model.job.CurvePoint` has them."""

from plateau.metric import Estimate, Evidence, Verdict
from plateau.picture.merged_image import MergedImage


def of_merge(merge: MergedImage) -> dict[str, object]:
    """Return how many samples there are."""
    spp = merge.spp_range
    zones = {} if spp is None else {"spp_min": spp[0], "spp_max": spp[1]}
    return {"spp": merge.spp, "samples": merge.samples, **zones}


def of_curve(reverse: Verdict) -> dict[str, object]:
    """Return what has changed visibly since the first image."""
    numbers = reverse.numbers
    return {
        "visible_pixels": int(numbers["visible_pixels"] or 0),
        "visible_fraction": numbers["visible_fraction"],
        "slope": numbers["slope"],
        "non_finite_pixels": int(numbers["non_finite_pixels"] or 0),
    }


def of_estimate(estimate: Estimate | None) -> dict[str, object]:
    """Return the noise left."""
    if estimate is None:
        return {"estimate_pixels": None, "estimate_fraction": None}
    return {
        "estimate_pixels": estimate.pixels,
        "estimate_fraction": estimate.fraction,
        "estimate_low_pixels": estimate.low_pixels,
        "estimate_high_pixels": estimate.high_pixels,
    }


def of_denoising(evidence: Evidence, raw: Evidence, target: float | None) -> dict[str, object]:
    """Return what the evidence of a denoised image has beside the estimate."""
    if evidence.estimate is None or raw.estimate is None:
        return {}
    allowed = evidence.allowed_pixels(target) if target else 0.0
    return {
        "estimate_undetermined": not evidence.estimate.is_determined(allowed),
        "raw_estimate_pixels": raw.estimate.pixels,
    }


def of_rule(verdict: Verdict, *, stop: bool) -> dict[str, object]:
    """Return what a rule said, as `plateau.farm.model.job.WatchedValue` has it."""
    known = {name: verdict.numbers.get(name) for name in ("low", "high", "few_share")}
    return {"value": verdict.value, "stop": stop, **known}
