"""The picture of a curve: all that is written is on it, and hides nothing."""

import json
from datetime import datetime, timezone
from typing import TYPE_CHECKING

import pytest

from plateau.farm.model.job import CurvePoint, WatchedValue
from plateau.files.plot import Marks, curve_figure
from plateau.rules import create

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOW = datetime(2026, 11, 22, tzinfo=timezone.utc)
STOPS = {"visible": 1400, "myszkowski": 1300, "reverse": 1300, "successive": 200}


def curve(changed: list[int], pixels: int) -> list[CurvePoint]:
    """A point each 100 spp; the noise left falls as the changed pixels rise."""
    return [
        CurvePoint(
            spp=100 * (number + 1),
            visible_pixels=count,
            visible_fraction=count / pixels,
            slope=max(changed) / 5800,
            estimate_pixels=max(changed) / (number + 1) ** 2,
            estimate_fraction=max(changed) / (number + 1) ** 2 / pixels,
            estimate_low_pixels=max(changed) / (number + 2) ** 2,
            estimate_high_pixels=max(changed) / (number + 0.7) ** 2,
            at=NOW,
        )
        for number, count in enumerate(changed)
    ]


#: How the pixels that have changed can go: slowly, at once, and hardly at all.
WAYS = {
    "rising": [2800 * number // (number + 2) for number in range(14)],
    "falling": [2800 - 190 * number for number in range(14)],
    "a few": [0] * 13 + [1],
    "one point": [40],
}


@pytest.mark.parametrize("pixels", [65_536, 8_294_400, 33_177_600])
@pytest.mark.parametrize("way", WAYS)
def test_no_word_is_cut_and_none_hides_a_point(way: str, pixels: int) -> None:
    # Given curves of small and of large images, with all that a picture can show
    changed = [count * pixels // 3000 if way != "a few" else count for count in WAYS[way]]
    stops = {name: min(spp, 100 * len(changed)) for name, spp in STOPS.items()}
    marks = Marks(window=5, stop_slope=0.1, target=0.0002, stops=stops)
    name = "the-scene-that-has-the-longest-name-of-all-the-scenes-of-the-lab"
    figure = curve_figure(name, "reached its cap at 1,400 spp", curve(changed, pixels), marks)
    # Then each word is on the picture as a whole, and no point of the curve is under any
    for text, box in written(figure):
        assert figure.bbox.x0 <= box.x0, text
        assert box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.y1 <= figure.bbox.y1, text
        for point in drawn(figure):
            assert not box.contains(*point), text


def written(figure: "Figure"):
    """Each text on the figure, with its box."""
    from matplotlib.text import Text

    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    beyond = {label for axes in figure.axes for label in beyond_the_ends(axes)}
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and text not in beyond:
            yield text.get_text(), text.get_window_extent(renderer)


def beyond_the_ends(axes: "Axes"):
    """The numbers that an axis has beyond its ends, where it draws none."""
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        for tick in axis.get_major_ticks():
            if not low <= tick.get_loc() <= high:
                yield from (tick.label1, tick.label2)


def drawn(figure: "Figure"):
    """Where the curves' points lie."""
    for axes in figure.axes:
        for line in axes.lines:
            if line.get_marker() != "None":
                yield from axes.transData.transform(line.get_xydata())


def test_it_names_what_it_shows_by_the_two_terms() -> None:
    marks = Marks(window=5, stop_slope=None, target=0.0002, stops={})
    figure = curve_figure("box", "rendering", curve(WAYS["rising"], 65_536), marks)
    said = json.dumps([text for text, _ in written(figure)])
    for term in ("changed since the first image", "noise left", "target: 0.02 % of the image"):
        assert term in said
    assert "visible" not in said


def test_it_has_a_third_plot_of_the_values_of_a_rule_with_its_own() -> None:
    points = [
        point.model_copy(update={"rules": {"jod": WatchedValue(value=value, stop=False)}})
        for point, value in zip(curve([9, 5, 4], 65_536), (None, 8.4, 9.1), strict=True)
    ]
    rule = create("jod", target=9.5)
    marks = Marks(window=5, stop_slope=None, target=None, stops={"x": 300}, valued=rule)
    figure = curve_figure("box", "rendering", points, marks)
    said = [text for text, _ in written(figure)]
    assert {"quality, in JOD", "target: 9.5 JOD"} <= set(said)
    assert list(figure.axes[2].lines[0].get_ydata()) == [8.4, 9.1]
