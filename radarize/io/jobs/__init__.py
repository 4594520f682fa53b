"""Work that takes long, done beside each other: by processes of this machine, or on a Ray cluster, by the same call.

    for news in perform({"one": job, "other": another}, workers=4):     # or ray="auto"
        ...

A job is a callable that can be pickled. It takes what it tells its progress to, and returns its result; a job that
fails ends with a sentence and stops no other. A worker that dies is replaced and its job begun again, so a job leaves
nothing half-done that it could not begin anew. Leaving the loop, by Ctrl-C for one, ends all workers, and nothing else.
"""

from collections.abc import Iterator, Mapping

from radarize.io.jobs.job import Job, News, Report, attempt

__all__ = ["Job", "News", "Report", "attempt", "perform"]


def perform(
    jobs: Mapping[str, Job],
    workers: int | None = None,
    ray: str | None = None,
    alone: bool = False,
) -> Iterator[News]:
    """Do jobs, in any order.

    Args:
        jobs: by name, which sentences on them begin with.
        workers: local processes, each with its share of the cores; one per core if None.
        ray: address of a Ray cluster (``auto``: the one of this machine) to use instead, one core a job. Files that
            jobs read and write must lie under the same path on every node.
        alone: each job has all cores of a machine for itself.

    Yields:
        how far jobs are, and how each ended.

    Raises:
        InputError: Ray is not installed, or no cluster answers.
    """
    if not jobs:
        return iter(())
    if ray is not None:
        from radarize.io.jobs import cluster

        return cluster.perform(jobs, ray, alone)
    from radarize.io.jobs import local

    return local.perform(jobs, 1 if alone else workers)
