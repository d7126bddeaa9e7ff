"""What a plugin raises while it renders fails its job at once: another try would raise it again."""

from pathlib import Path

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.model.states import JobState
from plateau.worker.supervisor.variants import LLVM, VariantChoice
from tests.support.farms.bench import SCENE, Bench
from tests.support.until import until
from tests.support.variants import VARIANTS, known_probe, library_for

#: Laid in the place of the child's renderer: the real one, with a plugin of the farm's own.
RENDERER = """
import importlib.util
import sys
from plateau.worker.renderers import mitsuba

spec = importlib.util.spec_from_file_location("real_renderer", f"{mitsuba.__path__[0]}/renderer.py")
real = importlib.util.module_from_spec(spec)
sys.modules["real_renderer"] = real
spec.loader.exec_module(real)


class Renderer(real.Renderer):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        import mitsuba as mi

        class Faulty(mi.SamplingIntegrator):
            def sample(self, *_):
                raise LookupError("there is no such texture\\nand no other")

        mi.register_integrator("faulty", Faulty)
"""
BOOT = """
import sys
if "plateau.worker.child" in sys.orig_argv:
    import own_renderer
    sys.modules["plateau.worker.renderers.mitsuba.renderer"] = own_renderer
"""


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_python_exception_while_rendering_fails_the_job_with_one_line(
    client: redis.Redis,
    redis_url: str,
    store: Blobs,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    variant: str,
) -> None:
    # Given a farm with a plugin of its own, which fails
    (tmp_path / "own_renderer.py").write_text(RENDERER)
    (tmp_path / "sitecustomize.py").write_text(BOOT)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    bench = Bench(client, redis_url, store, tmp_path)
    tried = known_probe(variant, library_for(variant))
    choice = VariantChoice(variant, tried.library if variant == LLVM else None, "", (tried,))
    job, _ = bench.job(slices=1, scene=SCENE.format(integrator="faulty"))
    # When a worker renders it
    with bench.worker(choice):
        until(lambda: bench.jobs.get(job.id).state.ended)
    # Then the job has failed, after one try, with one line
    failed = bench.jobs.get(job.id)
    assert failed.state is JobState.FAILED
    assert "LookupError: there is no such texture" in failed.reason
    assert "\n" not in failed.reason
    (entry,) = bench.jobs.log(job.id)
    # And the slice's log has the traceback
    assert (entry.what, entry.slice) == ("failed", 0)
    assert "Traceback" in entry.text
    assert "raise LookupError" in entry.text
