"""The map of zones says how noisy an image is, and not only where it is noisiest."""

import redis
from playwright.sync_api import Page, expect

from tests.page.conftest import Visit
from tests.support.farms.staged_job import HEIGHT, WIDTH, StagedJob

#: Of the two zones of each row: zones begin at multiples of 16 pixels.
PIXELS = (16 * 16, 16 * 8)


def colours(visit: Visit, client: redis.Redis, *pixels: int) -> list[float]:
    """How strong the map colours zones with so many noisy pixels, where a hundred are allowed."""
    job = StagedJob(
        client, rule={"name": "visible", "target": 100 / (WIDTH * HEIGHT)}, zones=(2, 2)
    )
    job.commit(4)
    noise = [
        [count / size for count in row]
        for row, size in zip((pixels[:2], pixels[2:]), PIXELS, strict=True)
    ]
    zones = {"estimate_fraction": noise, "visible_fraction": noise}
    job.point(100, 9, zones=zones)
    page: Page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".zones rect")).to_have_count(4)
    rects = page.locator(".zones rect").all()
    return [float(rect.get_attribute("fill-opacity") or "") for rect in rects]


def test_its_colours_go_by_the_target(visit: Visit, client: redis.Redis) -> None:
    few = colours(visit, client, 0, 1, 4, 20)
    many = colours(visit, client, 4, 20, 60, 120)
    # A zone has its colour whatever the others have, so a few pixels are faint wherever they are
    assert few[2:] == many[:2]
    assert few[0] == few[1] == few[2] == 0
    # More noise is a stronger colour, and what alone uses up all that is allowed is well seen
    assert 0 < many[1] < 0.2 < many[2] < 0.375 < many[3] < 0.75
