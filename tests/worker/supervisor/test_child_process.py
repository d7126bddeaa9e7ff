"""The render child renders, can be cancelled, and dies without taking anyone along."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import psutil
import pytest

from plateau.farm.model.seeds import Pass
from plateau.worker.renderers.contract import Loaded, SceneError, answer_line
from plateau.worker.supervisor import child_process, child_watch
from plateau.worker.supervisor.child_process import Cancelled, ChildDied, Film, RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from tests.support.faults.loop_disk import LoopDisk
from tests.support.processes.relatives import orphan_of
from tests.support.scenes.bundles import PLY, mesh, scene
from tests.support.threads import beside

BOX = Path(__file__).parents[3] / "plateau" / "scenes" / "box"
LIMITS = ChildLimits(threads=2, memory_bytes=8 << 30, timeout_s=60)
SMALL = {"width": "16", "height": "12"}
LONG = (Pass(8192, 0),) * 1000  # more than anybody waits for


@pytest.fixture
def child(tmp_path: Path) -> Iterator[RenderChild]:
    child = RenderChild("scalar_rgb", None, LIMITS, tmp_path / "home", [BOX, tmp_path])
    yield child
    child.kill()


@pytest.fixture(scope="module")
def lasting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RenderChild]:
    """A child for all tests that do it no harm."""
    child = RenderChild("scalar_rgb", None, LIMITS, tmp_path_factory.mktemp("home"), [BOX])
    yield child
    child.kill()


def test_it_sums_the_passes_of_a_slice(lasting: RenderChild) -> None:
    scene = lasting.load(BOX, "scene.xml", SMALL, 0)
    assert (scene.width, scene.height) == (16, 12)
    one, _ = lasting.render((Pass(2, 7),))
    other, _ = lasting.render((Pass(1, 8),))
    both, render_s = lasting.render((Pass(2, 7), Pass(1, 8)))
    assert both.shape == (12, 16, 4)
    assert render_s > 0
    expected = (one.astype(np.float64) + other.astype(np.float64)).astype(np.float32)
    np.testing.assert_array_equal(both, expected)
    np.testing.assert_array_equal(both[..., 3], 3)  # a box filter's weights are the spp
    assert list(lasting._home.rglob("*film*")) == []


def test_it_shows_the_first_pass_where_the_others_take_a_while(lasting: RenderChild) -> None:
    # So few pixels that a pass takes longer to begin than many of its samples
    lasting.load(BOX, "scene.xml", {"width": "2", "height": "2"}, 0)
    seen: list[tuple[Film, int]] = []
    passes = (Pass(1, 7), Pass(16_384, 8), Pass(16_384, 9))
    film, _ = lasting.render(passes, lambda film, spp: seen.append((film, spp)))
    # What it shows is the first pass, and costs the slice nothing
    ((first, spp),) = seen
    assert spp == 1
    np.testing.assert_array_equal(first, lasting.render(passes[:1])[0])
    np.testing.assert_array_equal(film, lasting.render(passes)[0])
    # Where the slice is there in a moment, nothing is shown
    lasting.load(BOX, "scene.xml", SMALL, 0)
    lasting.render((Pass(64, 7), Pass(1, 8)), lambda film, spp: seen.append((film, spp)))
    lasting.render((Pass(1, 7),), lambda film, spp: seen.append((film, spp)))
    assert len(seen) == 1


class TestOnASmallDisk:
    SCENE: ClassVar = {"width": "512", "height": "256"}  # 2 MiB of film
    PASSES = (Pass(1, 7), Pass(16, 8))

    @pytest.fixture
    def disk(self, tmp_path: Path) -> Iterator[LoopDisk]:
        with LoopDisk(tmp_path / "disk", megabytes=8) as disk:
            yield disk

    @pytest.fixture
    def child(self, disk: LoopDisk) -> Iterator[RenderChild]:
        child = RenderChild("scalar_rgb", None, LIMITS, disk.folder / "home", [BOX])
        child.await_ready()
        yield child
        child.kill()

    @pytest.mark.long
    def test_a_glimpse_without_room_is_left_out(self, child: RenderChild, disk: LoopDisk) -> None:
        seen: list[int] = []
        # Given room for a film and a half
        ballast = disk.fill(leaving=3 << 20)
        child.load(BOX, "scene.xml", self.SCENE, 0)
        # Then the slice is rendered, and nothing is shown of it, however often it is tried
        film, _ = child.render(self.PASSES, lambda _, spp: seen.append(spp))
        child.render(self.PASSES, lambda _, spp: seen.append(spp))
        assert seen == []
        # And where there is room it is the same, and is shown
        ballast.unlink()
        again, _ = child.render(self.PASSES, lambda _, spp: seen.append(spp))
        assert seen == [1]
        np.testing.assert_array_equal(again, film)

    def test_a_film_without_room_is_the_disks_fault(
        self, child: RenderChild, disk: LoopDisk
    ) -> None:
        # Given the megabyte that the worker's test of itself takes
        ballast = disk.fill(leaving=1 << 20)
        with pytest.raises(OSError, match=rf"written into {disk.folder}/home: No space left"):
            child.load(BOX, "scene.xml", self.SCENE, 0)
        # Then it lives, takes no room, and can do with what there is
        assert child.alive
        child.load(BOX, "scene.xml", SMALL, 0)
        child.render((Pass(1, 0),))
        # And a disk that fills up later harms no scene that is loaded
        ballast.unlink()
        child.load(BOX, "scene.xml", self.SCENE, 0)
        disk.fill()
        film, _ = child.render((Pass(1, 7),))
        np.testing.assert_array_equal(film[..., 3], 1)


def test_what_mitsuba_says_of_a_file_is_told_with_its_name(
    child: RenderChild, tmp_path: Path
) -> None:
    # Given a sun below the horizon, an image of no kind, and a mesh that ends Mitsuba
    image = '<texture type="bitmap" name="reflectance"><string name="filename" value="wood"/>'
    image = f'<bsdf type="diffuse">{image}</texture></bsdf>'
    sky = '<emitter type="sunsky"><vector name="sun_direction" value="1,0,-1"/></emitter>'
    start = '<integrator type="path"/>'
    for name, xml in {
        "warns.xml": scene(start, sky),
        "black.xml": scene(
            start, '<emitter type="point"><rgb name="intensity" value="0"/></emitter>'
        ),
        "odd.xml": scene(start, f'<shape type="rectangle">{image}</shape>'),
        "dies.xml": scene(start, mesh("m/a.ply")),
    }.items():
        (tmp_path / name).write_bytes(xml)
    (tmp_path / "wood").write_bytes(b"of no kind" * 9)
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "a.ply").write_bytes(PLY.replace(b"3 0 1 2", b"3 0 1 2000000000"))
    # When they are loaded, the warning is a note, and errors and the death name the file
    loaded = child.load(tmp_path, "warns.xml", {}, 0)
    assert any("Mitsuba warns: The sun is below the horizon" in one for one in loaded.notes)
    assert "DEBUG" not in child.take_words()
    child.load(tmp_path, "black.xml", {}, 0)
    child.render((Pass(1, 0),))
    assert child.notes[0].startswith("the image is black, since no light arrived: look whether")
    with pytest.raises(SceneError, match=r"Unknown file format.* \(wood\)$"):
        child.load(tmp_path, "odd.xml", {}, 0)
    with pytest.raises(ChildDied, match=r"SIGSEGV while loading the scene: .*the file a\.ply$"):
        child.load(tmp_path, "dies.xml", {}, 0)


def test_a_cancel_ends_the_render_after_its_pass(
    lasting: RenderChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_process, "CANCEL_GRACE_S", 60.0)
    lasting.load(BOX, "scene.xml", SMALL, 0)
    with beside(lasting.cancel, 0.3), pytest.raises(Cancelled):
        lasting.render((Pass(64, 0),) * 100_000)
    # Then the child is alive, since no force was needed, and the next request is not cancelled too
    assert lasting.alive
    lasting.render((Pass(1, 0),))


def test_a_pass_that_outlasts_a_cancel_is_ended_by_force(
    child: RenderChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_process, "CANCEL_GRACE_S", 0.5)
    child.load(BOX, "scene.xml", {"width": "256", "height": "256"}, 0)
    process = psutil.Process(child.pid)
    loaded_s = process.cpu_times().user

    def cancel() -> None:
        with contextlib.suppress(psutil.NoSuchProcess):
            if process.cpu_times().user > loaded_s + 0.3:  # it is in its pass
                child.cancel()

    with beside(cancel, 0.1), pytest.raises(Cancelled):
        child.render(LONG)
    assert not child.alive


def test_a_hanging_pass_is_killed(child: RenderChild) -> None:
    child.load(BOX, "scene.xml", {"width": "256", "height": "256"}, 0)
    child._limits = ChildLimits(threads=2, memory_bytes=0, timeout_s=1.5)
    with pytest.raises(ChildDied, match=r"rendering a pass took longer than 1\.5 s"):
        child.render(LONG)
    assert not psutil.pid_exists(child.pid)


def test_one_that_is_stopped_is_ended(child: RenderChild, monkeypatch: pytest.MonkeyPatch) -> None:
    child.load(BOX, "scene.xml", SMALL, 0)
    monkeypatch.setattr(child_watch, "STILL_S", 2.0)
    monkeypatch.setattr(child_watch, "_TOLD_S", 0.5)
    os.kill(child.pid, signal.SIGSTOP)
    stuck, seen = child._watch.stuck, set()

    def look() -> str | None:
        seen.add(child.trouble)
        return stuck()

    monkeypatch.setattr(child._watch, "stuck", look)
    with pytest.raises(ChildDied, match="used no processor time for 2 s while rendering a pass"):
        child.render(LONG)
    assert seen - {None} == {"its render child uses no processor time; it is ended after 2 s"}
    assert not psutil.pid_exists(child.pid)
    assert child.trouble is None


def test_one_that_reads_no_request_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_process, "STILL_S", 1.0)
    child = RenderChild("scalar_rgb", None, LIMITS, tmp_path / "home", [BOX])
    child.load(BOX, "scene.xml", SMALL, 0)
    os.kill(child.pid, signal.SIGSTOP)
    # When a request is longer than what waits in a socket
    with pytest.raises(ChildDied, match="read no request for 1 s"):
        child.render((Pass(1, 0),) * 100_000)
    assert not psutil.pid_exists(child.pid)


def test_a_slow_scene_is_left_alone(lasting: RenderChild, monkeypatch: pytest.MonkeyPatch) -> None:
    lasting.load(BOX, "scene.xml", {"width": "96", "height": "96"}, 0)
    lasting.render((Pass(1, 0),))
    # Given a child that would be late after a moment
    monkeypatch.setattr(child_watch, "_LEAST_S", 0.1)
    monkeypatch.setattr(child_watch, "_OFF_PACE", 1.0)
    # Then a pass that takes far longer, for it has more samples, is no sign of anything
    film, render_s = lasting.render((Pass(64, 1),))
    assert render_s > 0.01
    np.testing.assert_array_equal(film[..., 3], 64)


def test_one_that_works_is_not_stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    # For the watch alone: other threads would wait for hours, or not at all
    monkeypatch.setattr(child_watch, "time", SimpleNamespace(monotonic=lambda: now))
    watch = child_watch.ChildWatch(os.getpid(), on_gpu=False)
    watch.asked()
    # Though it answers nothing for longer than one may be still
    for _ in range(3):
        spun_until = time.process_time() + 0.05
        while time.process_time() < spun_until:
            pass
        assert watch.stuck() is None
        now += 2 * child_watch.STILL_S


def test_one_that_falls_off_its_pace_is_ended(
    child: RenderChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child_watch, "_LEAST_S", 2.0)
    child.load(BOX, "scene.xml", SMALL, 0)
    child.render((Pass(1, 0),))
    child._watch._longest_s = 0.01
    # When it ends no pass after its first, though others like it took a moment
    with pytest.raises(ChildDied, match=r"rendering a pass took longer than [\d.]+ s"):
        child.render((Pass(1, 1),) * 100_000, lambda *_: os.kill(child.pid, signal.SIGSTOP))
    assert not psutil.pid_exists(child.pid)


def test_a_scene_that_wants_too_much_memory_costs_its_child(tmp_path: Path) -> None:
    limits = ChildLimits(threads=1, memory_bytes=1 << 30, timeout_s=600)
    child = RenderChild("scalar_rgb", None, limits, tmp_path / "home", [BOX])
    child.load(BOX, "scene.xml", {"width": "8192", "height": "8192"}, 0)
    with pytest.raises(ChildDied, match=r"out of memory|SIGABRT"):
        child.render((Pass(1, 0),))
    assert not child.alive


def test_it_does_not_outlive_a_supervisor_that_is_killed(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path\n"
        "from plateau.worker.supervisor.child_process import RenderChild\n"
        "from plateau.worker.supervisor.child_start import ChildLimits\n"
        "limits = ChildLimits(threads=1, memory_bytes=0, timeout_s=60)\n"
        "print(RenderChild('scalar_rgb', None, limits, Path(sys.argv[1]), []).pid, flush=True)\n"
        "time.sleep(60)"
    )
    orphan_of(program, tmp_path).wait(60)


@pytest.mark.parametrize(
    ("lie", "why"),
    [
        (Loaded(width=8, height=8, channels=("R", "G", "B")), "begin with R, G, B and W"),
        (Loaded(width=8, height=8, ids=("Z",)), "ids are AOVs"),
        (Loaded(width=8, height=8, quotients=(("R", "Z"),)), "pairs of AOVs"),
        (Loaded(width=2**20, height=2**20), "at most 268,435,456"),
        (Loaded(width="8", height=8), "has no size"),
        (Loaded(width=-8, height=-8), "has no size"),
    ],
)
def test_a_film_that_no_honest_child_has_ends_it(tmp_path: Path, lie: Loaded, why: str) -> None:
    child = RenderChild("analytic:numpy", None, LIMITS, tmp_path / "home", [tmp_path])
    child.await_ready()
    child._received = answer_line(lie).encode()  # as if it had come from the child
    with pytest.raises(ChildDied, match=why):
        child.load(tmp_path, "scene.json", {}, 0)
    assert not child.alive
