"""`plateau.render`: a scene to its image from a Python program, with real processes."""

import json
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import plateau
from plateau import InvalidSpec, RenderFailed, Result
from plateau.errors import CommandFailed
from plateau.farm.bundle import BundleError
from tests.support.farms.real_farm import RealFarm
from tests.support.processes.commands import Command, starting

#: A scene that needs no Mitsuba.
CHECKS = {"analytic": 1, "width": 40, "height": 30, "light": "checks", "level": 0.2}
#: What a program does with a scene; it leaves the result in a file.
PROGRAM = """
import pickle, plateau, plateau.rendering.own_farm as own_farm
from pathlib import Path
own_farm._ROOM = {room}
try:
    result = plateau.render({scene}, threads=1, **{options})
except plateau.RenderFailed as failed:
    print("failed:", failed)
    result = failed.result
Path("result").write_bytes(pickle.dumps(result))
print(result)
"""

Run = Callable[..., Command]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Run]:
    """Runs the program in a folder with ``checks.json``."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "checks.json").write_text(json.dumps(CHECKS))

    def start(scene: str = "'checks.json'", *, room: int = 0, **options: object) -> Command:
        program = PROGRAM.format(scene=scene, room=room, options=options)
        return Command(program=("-c", program), folder=tmp_path)

    yield from starting(start)


def result_of(command: Command) -> Result:
    """What the program left, once it and all that it started are gone."""
    assert command.exit_code() == 0, command.said
    command.is_gone()
    assert list(command.temporary.iterdir()) == []
    result = pickle.loads(Path("result").read_bytes())
    assert isinstance(result, Result)
    return result


def test_a_path_becomes_an_image_and_a_curve(run: Run, tmp_path: Path) -> None:
    fixed = {"rule": {"name": "fixed", "spp": 100}, "step": 50, "workers": 2}
    command = run(**fixed, out="out", aovs=["depth"], room=1 << 60)
    result = result_of(command)
    assert command.said.count("MB left: what does not fit waits for room") == 1
    assert (result.state.value, result.spp) == ("converged", 100)
    assert result.reason == "the fixed 100 spp are reached: 100 spp"
    assert repr(result) == f"<plateau.Result: converged at 100 spp: {result.reason}>"
    # Its pixels are arrays, alone and by name
    assert (result.image.shape, result.image.dtype) == ((30, 40, 3), np.float32)
    assert np.array_equal(result.image[..., 1], result.channels["G"])
    assert result.channels.keys() == {"R", "G", "B", "Z"}
    # Its curve has columns
    assert result.curve["spp"].tolist() == [50, 100]
    # A notebook shows the picture, the curve and the words
    html = result._repr_html_()
    assert html.count("<img ") == html.count("<svg ") == 1
    assert result.reason in html
    assert (result._repr_png_() or b"").startswith(b"\x89PNG")
    # Progress was shown as the command shows it
    assert "50 spp" in command.said
    # And everything can be written, long after its farm has gone
    assert result.save("box.exr").read_bytes() == result.files["image.exr"]
    assert result.save("box.png").read_bytes() == result.files["image.png"]
    folders = [tmp_path / "out", result.save(tmp_path / "saved")]
    written, saved = ({path.name for path in folder.iterdir()} for folder in folders)
    assert {"image.exr", "image.png", "curve.csv", "curve.svg", "summary.json"} < saved
    assert written == saved
    assert (folders[0] / "curve.csv").read_text() == (folders[1] / "curve.csv").read_text()


@pytest.mark.long
def test_a_scene_that_mitsuba_refuses_is_an_error_with_its_words(run: Run) -> None:
    scene = {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8}},
        "shape": {"type": "rectangle", "faces": 12},
    }
    command = run(repr(scene), variant="scalar_rgb")
    result = result_of(command)
    assert result.state.value == "failed"
    assert "failed: the job failed: " in command.said
    assert "faces" in command.said
    # There is no image
    assert not result.has_image
    assert result._repr_png_() is None
    with pytest.raises(CommandFailed, match=r"has no image\.exr: failed, "):
        _ = result.image
    # And its error survives a pickle
    error = pickle.loads(pickle.dumps(RenderFailed(result)))
    assert str(error) == f"the job failed: {result.reason}"
    assert error.result.job == result.job


def test_a_farm_renders_the_same(
    farm: RealFarm, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "checks.json").write_text(json.dumps(CHECKS))
    spec = plateau.JobSpec(max_spp=50, step=25, allocation={"name": "frame"})
    results = [
        plateau.render(tmp_path / "checks.json", spec, farm=farm.url, seed=np.int64(seed))
        for seed in (0, 0, 1)
    ]
    assert {result.state.value for result in results} == {"exhausted"}
    same, other = (np.array_equal(results[0].image, one.image) for one in results[1:])
    assert (same, other) == (True, False)
    assert "50 spp" in capsys.readouterr().err
    there = {job.id: job.state for job in farm.client.all_jobs()}
    assert [there[result.job.id] for result in results] == ["exhausted"] * 3


def test_what_is_wrong_is_told_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="there is no scenes:bix; there are scenes:bar"):
        plateau.render("scenes:bix")
    with pytest.raises(BundleError, match=r"gone\.xml: there is no such file"):
        plateau.render(tmp_path / "gone.xml")
    with pytest.raises(BundleError, match="the dict has the type 'sphere', not 'scene'"):
        plateau.render({"type": "sphere"})
    with pytest.raises(
        TypeError, match="a scene is a path, scenes:NAME or a Mitsuba dict, not int"
    ):
        plateau.render(3)  # type: ignore[arg-type]
    with pytest.raises(InvalidSpec, match=r"spec\.max_sp: there is no such field"):
        plateau.render("scenes:box", max_sp=100)
    (tmp_path / "file").touch()
    with pytest.raises(CommandFailed, match="is a file"):
        plateau.render("scenes:box", out=tmp_path / "file")
