"""An allocation that the first worker's variant decides, after a monitor has begun."""

from tests.support.farms.noise_farm import NoiseFarm


def test_a_job_of_whole_films_is_that_of_one_that_asked_for_them(farm: NoiseFarm) -> None:
    spec = {"rule": "jod", "max_spp": 400}
    with farm.monitor():
        auto, frame = (farm.submit(**spec, allocation=one) for one in ("auto", "frame"))
        for job in (auto, frame):
            farm.work(lambda job=job: farm.jobs.get(job.id).finished_at)
    became = farm.jobs.get(auto.id)
    assert (became.spec.allocation.name, became.frames_because) == ("frame", "variant")
    curves = [
        [(one.spp, one.visible_pixels, one.rules) for one in farm.jobs.curve(job.id)]
        for job in (auto, frame)
    ]
    assert curves[0] == curves[1] != []
