"""`plateau render`: from a scene to its results, for real, with Mitsuba."""

import json
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from tests.support.long_tests import rare
from tests.support.processes.commands import Command, starting
from tests.support.scenes.bundles import scene
from tests.support.until import until

#: A lit floor, small enough to take no time.
FLOOR = scene(
    '<integrator type="direct"/><emitter type="constant"/><shape type="rectangle"/>',
    sensor='<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="24"/>'
    '<integer name="height" value="16"/><rfilter type="box"/></film></sensor>',
)

Render = Callable[..., Command]


@pytest.fixture
def render(tmp_path: Path) -> Iterator[Render]:
    (tmp_path / "floor.xml").write_bytes(FLOOR)

    def start(*options: str, text: bytes = FLOOR, hides_gpus: bool = False) -> Command:
        path = tmp_path / "floor.xml"
        path.write_bytes(text)
        out = str(tmp_path / "out")
        # scalar: no library to look for; short leases: whoever dies is soon replaced
        arguments = ("render", str(path), "-o", out, "--variant", "scalar_rgb", *options)
        leases = {"PLATEAU_LEASE_S": "2"}
        gpus = {"CUDA_VISIBLE_DEVICES": ""} if hides_gpus else {}
        return Command(*arguments, folder=tmp_path, **leases, **gpus)

    yield from starting(start)


def left_nothing(command: Command) -> None:
    command.is_gone()
    assert list(command.temporary.iterdir()) == []


def test_a_scene_becomes_an_image(render: Render, tmp_path: Path) -> None:
    command = render("--rule", "fixed", "--spp", "100", "--step", "50", "--workers", "1")
    assert command.exit_code(120) == 0
    left_nothing(command)
    out = tmp_path / "out"
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["state"], summary["spp"]) == ("converged", 100)
    assert [point["spp"] for point in summary["curve"]] == [50, 100]
    assert {path.name for path in out.iterdir() if path.name[0] != "."} == {
        "curve.csv",
        "curve.svg",
        "difference.png",
        "image.exr",
        "image.png",
        "noise.png",
        "summary.json",
        "summary.txt",
    }
    # In a pipe, progress is a line for each point, and the end is in words
    assert "rendering with scalar_rgb" in command.said
    assert "50 spp" in command.said
    assert "of the cap" not in command.said  # the rule fixed saves nothing


@pytest.mark.long  # TestAFolderThatCannotBeWritten has the cheaper half of it
def test_ctrl_c_cancels_and_writes_what_there_is(render: Render, tmp_path: Path) -> None:
    command = render("--rule", "fixed", "--spp", "1000000", "--max-spp", "1000000")
    command.wait_for(r"200 spp")
    command.family()
    command.process.send_signal(signal.SIGINT)
    assert command.exit_code() == 130
    assert "cancelling; the results so far are kept" in command.said
    left_nothing(command)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["state"] == "cancelled"
    assert summary["spp"] >= 200
    assert (tmp_path / "out" / "image.exr").exists()


@pytest.mark.parametrize("begun", [False, True], ids=["at the start", "in the queue"])
def test_ctrl_c_before_anything_is_rendered_leaves_what_was_there(
    begun: bool, render: Render, tmp_path: Path
) -> None:
    # Given results of an earlier job, and a farm that starts, or whose worker does not move
    out = tmp_path / "out"
    out.mkdir()
    (out / ".plateau-job").write_text("0123456789ab\n")
    (out / "image.png").write_text("an earlier image")
    command = render("--rule", "fixed", "--spp", "1000000", "--max-spp", "1000000")
    until(command.family)
    if begun:
        worker = command.member("worker")
        worker.suspend()
        command.wait_for("queued")
        # Other users of this machine have no key
        (lock,) = command.temporary.glob("plateau-render-*/lock")
        url = f"{json.loads(lock.read_text())['url']}/v1/jobs"
        assert httpx.get(url, verify=False, trust_env=False, timeout=60).status_code == 401
    # When it is interrupted
    command.process.send_signal(signal.SIGINT)
    if begun:
        command.wait_for("cancelling")
        worker.resume()
    # Then it leaves at once, and no summary of nothing takes the place of an image
    assert command.exit_code() == 130
    left_nothing(command)
    assert (out / "image.png").read_text() == "an earlier image"
    assert not (out / "summary.json").exists()


def test_when_it_is_killed_nothing_runs_on(render: Render) -> None:
    command = render("--rule", "fixed", "--spp", "1000000", "--max-spp", "1000000")
    command.wait_for("200 spp")
    assert len(command.family()) >= 5  # Redis, API, monitor, worker, render child
    command.process.kill()
    command.is_gone()  # the worker tries for a few seconds to commit
    # What it left on disk goes with the next one
    left = [*command.temporary.glob("plateau-render-*")]
    assert left
    again = render()
    until(lambda: not any(path.exists() for path in left), 120, lambda: again.said)


class TestWhatItsOwnWorkersCannotDo:
    """They are there for this job alone: nobody else will come who can."""

    def test_a_variant_is_refused_at_once(self, render: Render, tmp_path: Path) -> None:
        # Given a machine without a GPU, and a limit that would end the wait
        command = render("--variant", "cuda_ad_rgb", "--time-limit", "3600", hides_gpus=True)
        assert command.exit_code() == 1
        left_nothing(command)
        assert command.said.startswith("plateau: this machine cannot render with cuda_ad_rgb")
        assert "leave --variant out" in command.said
        assert len(command.said.splitlines()) == 1
        assert not (tmp_path / "out").exists()

    @pytest.mark.long
    def test_a_time_limit_counts_from_the_submission(self, render: Render, tmp_path: Path) -> None:
        # Given a limit that is over before any worker could have started
        command = render("--time-limit", "0.1", "--rule", "fixed", "--spp", "10000")
        code = command.exit_code()
        left_nothing(command)
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["spec"]["time_limit_from"] == "submission"
        # Then it ends at once: without an image, or with the slices that a worker had rendered
        # before the monitor was there
        if summary["state"] == "failed":
            said = "no slice of it was rendered within its time limit of 0.1 s"
            assert (code, summary["reason"]) == (1, said)
        else:
            assert (code, summary["state"]) == (0, "exhausted")
            assert summary["reason"].startswith("reached its time limit of 0.1 s at ")
            assert summary["spp"] < 10_000


class TestAFolderThatCannotBeWritten:
    """It is told of before anything is rendered, or else what was rendered is kept elsewhere."""

    def test_is_refused_before_anything_is_started(self, render: Render, tmp_path: Path) -> None:
        (tmp_path / "out" / "image.png").mkdir(parents=True)
        command = render()
        assert command.exit_code() == 1
        left_nothing(command)
        assert command.said == (
            f"plateau: {tmp_path / 'out' / 'image.png'} is a folder, and a file of this name must "
            "be written: move it, or give another folder with -o\n"
        )
        # Nobody may write there, root neither
        command = render("-o", "/proc")
        assert command.exit_code() == 1
        left_nothing(command)
        assert command.said.startswith("plateau: cannot write into /proc (")
        assert command.said.endswith("): give another folder with -o\n")

    @pytest.mark.parametrize(
        ("taken", "kept"),
        [
            ("image.png", {"image.exr", "image.png", "curve.csv", "summary.json"}),
            # The API has stopped by then
            *rare(("curve.svg", {"image.exr", "curve.svg", "summary.json"})),
        ],
    )
    def test_in_the_end_costs_nothing_that_was_rendered(
        self, render: Render, tmp_path: Path, taken: str, kept: set[str]
    ) -> None:
        # Given a render under way
        command = render("--rule", "fixed", "--spp", "1000000", "--max-spp", "1000000")
        command.wait_for("200 spp")
        command.family()
        # If one of its files cannot be written any more when it ends
        (tmp_path / "out" / taken).mkdir()
        command.process.send_signal(signal.SIGINT)
        # Then it says so, and where the rest is
        assert command.exit_code() == 1
        command.is_gone()
        assert "cancelling; the results so far are kept" in command.said
        out = tmp_path / "out"
        said = f"plateau: the results could not be written into {out} (Is a directory): "
        assert said in command.said
        rest = Path(command.wait_for(r"they are in (.+); move them to where you want them"))
        assert {path.name for path in rest.iterdir()} >= kept
        summary = json.loads((rest / "summary.json").read_text())
        assert (summary["state"], summary["spp"] >= 200) == ("cancelled", True)
        assert [path.name for path in out.iterdir()] == [taken]
