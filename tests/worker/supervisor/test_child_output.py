"""What the render child prints is kept for the job's log, slice by slice, and none of it twice."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.farm.model.job import LogEntry
from plateau.farm.model.states import JobState
from plateau.worker.renderers.contract import SceneError
from plateau.worker.supervisor.child_process import ChildDied, RenderChild
from plateau.worker.supervisor.child_start import ChildLimits
from tests.support.farms.bench import SCENE, Bench, the_child
from tests.support.until import until

LIMITS = ChildLimits(threads=2, memory_bytes=8 << 30, timeout_s=60)
#: Mitsuba warns of the sun, and renders.
SUN = '<emitter type="sunsky"><vector name="sun_direction" value="1,0,-1"/></emitter>'
WARNED_OF = SCENE.format(integrator="path").replace('<emitter type="constant"/>', SUN)
WARNING = "The sun is below the horizon"
SMALL = {"size": "16"}


@pytest.fixture
def child(tmp_path: Path) -> Iterator[RenderChild]:
    child = RenderChild("scalar_rgb", None, LIMITS, tmp_path / "home", [tmp_path])
    yield child
    child.kill()


def scene(folder: Path, text: str) -> Path:
    (folder / "scene.xml").write_text(text)
    return folder


def test_words_are_taken_once_and_without_their_colours(child: RenderChild, tmp_path: Path) -> None:
    folder = scene(tmp_path, WARNED_OF)
    for _ in range(2):  # it goes on writing where its words have been taken
        child.load(folder, "scene.xml", SMALL, 0)
        words = child.take_words()
        assert WARNING in words
        assert len(words.splitlines()) == 1
        assert words.isprintable()
        assert child.take_words() == ""


def test_the_words_of_a_dead_child_are_there_still(child: RenderChild, tmp_path: Path) -> None:
    folder = scene(tmp_path, WARNED_OF)
    child.load(folder, "scene.xml", SMALL, 0)
    the_child().send_signal(signal.SIGABRT)
    with pytest.raises(ChildDied, match=r"SIGABRT while loading.*WARN.*below the horizon"):
        child.load(folder, "scene.xml", SMALL, 0)
    assert WARNING in child.take_words()
    assert child.take_words() == ""


def test_a_name_is_no_lack_of_memory(child: RenderChild, tmp_path: Path) -> None:
    # Given a mesh whose normal has no length, under a name that says something else
    (tmp_path / "out of memory.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1\n"
    )
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"/>'
        '<shape type="obj"><string name="filename" value="out of memory.obj"/></shape></scene>'
    )
    # Then it is the scene's fault, told without a folder of the worker's
    with pytest.raises(SceneError, match="invalid vertex normal") as refused:
        child.load(tmp_path, "scene.xml", {}, 0)
    assert str(tmp_path) not in str(refused.value)
    assert child.alive


def log(bench: Bench, job_id: str) -> list[LogEntry]:
    return bench.jobs.log(job_id)


def test_warnings_and_errors_stand_in_the_log_of_the_slice_at_which_they_came(bench: Bench) -> None:
    job, _ = bench.job(slices=3, scene=WARNED_OF)
    wrong = WARNED_OF.replace('<bsdf type="diffuse"/>', '<bsdf type="nosuchplugin"/>')
    with bench.worker() as worker:
        until(lambda: len(bench.jobs.ledger(job.id)) == 3)
        bad, _ = bench.job(slices=1, scene=wrong)
        until(lambda: bench.jobs.get(bad.id).state is JobState.FAILED)
    first, *others = log(bench, job.id)
    assert (first.slice, first.what, first.worker) == (0, "committed", worker.id)
    assert WARNING in first.text
    assert first.seconds is not None
    assert [(one.slice, one.what, one.text) for one in others] == [
        (1, "committed", ""),
        (2, "committed", ""),
    ]
    # A scene error ends the log, and nothing in it says where this machine keeps things
    (entry,) = log(bench, bad.id)
    assert (entry.slice, entry.what) == (0, "failed")
    assert "nosuchplugin" in str(entry.cause)
    assert str(bench.settings.cache) not in entry.model_dump_json()
