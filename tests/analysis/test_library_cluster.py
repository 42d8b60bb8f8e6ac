"""The library on a real local cluster of processes, one of which is killed."""

from __future__ import annotations

import os
import signal

import pytest

from magbend.analysis.library.build import build, partition_count
from magbend.analysis.library.query import query
from magbend.analysis.library.space import Space
from magbend.core.errors import StoreError

pytestmark = pytest.mark.usefixtures("distributed")


@pytest.fixture(scope="module")
def distributed():
    """Return the package; who only collects the tests need not import it."""
    pytest.importorskip("pyarrow")
    return pytest.importorskip("distributed")


def space(designs: int) -> Space:
    moduli = {"from": 6.0, "to": 48.0}
    section = {"length_mm": {"from": 5.0, "to": 20.0}, "E_MPa": moduli}
    return Space.model_validate(
        {
            "name": "cluster",
            "method": "sobol",
            "designs": designs,
            "partition_rows": 2048,
            "side_mm": {"from": 0.75, "to": 1.35},
            "remanence_mT": 20.07,
            "flux_mT": {"from": 10.0, "to": 120.0},
            "section": [section] * 3,
        }
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # those of a killed cluster are not ours
def test_a_killed_worker_loses_and_repeats_nothing(tmp_path, distributed):
    what, out = space(50_000), tmp_path / "out"
    written: dict[str, int] = {}
    killed = []

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        victims = [worker.pid for worker in cluster.workers.values()]

        def tell(done: int, total: int) -> None:
            if done >= total // 4 and not killed:
                for path in out.glob("part-*.parquet"):
                    written[path.name] = path.stat().st_mtime_ns
                os.kill(victims[0], signal.SIGKILL)
                killed.append(victims[0])

        address = cluster.scheduler_address
        summary = build(what, out, scheduler=address, progress=tell)
    assert killed
    assert summary.solved_partitions == partition_count(what) == 25
    parts = {p.name: p.stat().st_mtime_ns for p in out.glob("part-*.parquet")}
    assert len(parts) == 25
    assert all(parts[name] == when for name, when in written.items())
    assert query(out, where="tip_y_mm > -1", top=1).matched == 50_000


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "no address at all"])
def test_an_unreachable_scheduler_is_one_sentence(tmp_path, address):
    with pytest.raises(StoreError, match="no Dask scheduler answers") as error:
        build(space(2000), tmp_path / "out", scheduler=address)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()
