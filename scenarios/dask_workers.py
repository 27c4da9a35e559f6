"""Workers of a Dask cluster, on this machine or on others, as lanes of a campaign: one lane a worker."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from scenarios.lanes import Kind
from scenarios.workers import WorkerError

PATIENCE_S = 10.0


@contextmanager
def dask_workers(address: str) -> Iterator[Kind]:
    """Yield the lanes of the workers that a scheduler at `tcp://host:port` has now.

    A scene goes to another worker when its own dies. Raises WorkerError without scheduler or workers, or where a worker
    has more than one thread: the watch over a scene that hangs ends its whole process.
    """
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise WorkerError("--dask needs the package distributed: pip install 'leakloc[dask]'") from None
    try:
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkerError(f"{address}: no Dask scheduler answers: {error}") from None
    with client:
        n_threads = client.nthreads()
        if not n_threads:
            raise WorkerError(f"{address}: the scheduler has no workers: start dask worker {address} --nthreads 1")
        for worker, n in n_threads.items():
            if n != 1:
                raise WorkerError(f"{worker}: must have one thread, has {n}: start dask worker {address} --nthreads 1")
        lanes = [
            partial(client.get_executor, workers=[worker], allow_other_workers=True, pure=False)
            for worker in sorted(n_threads)
        ]
        yield Kind(tuple(lanes), (KilledWorker,))
