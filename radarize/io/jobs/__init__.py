"""Parallel jobs, in processes of this machine or on a Ray cluster, with the same call.

    for news in perform({"one": job, "other": another}, workers=4):     # or ray="auto"
        ...

A job is a callable that can be pickled. It gets a function to report its progress, and returns its result; a job that
fails ends with an error sentence and does not stop the others. A worker that dies is replaced and its job started
again, so a job must not leave partial results that prevent a restart. Leaving the loop, for example by Ctrl-C, ends all
workers.
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
    """Run jobs in parallel, in any order.

    Args:
        jobs: jobs by name; error sentences begin with the name.
        workers: number of local processes, which share the cores; one per core if None.
        ray: address of a Ray cluster (``auto``: that of this machine) to use instead, with one core per job. Files that
            jobs read and write must have the same path on every node.
        alone: each job gets all cores of a machine.

    Yields:
        progress and end of jobs, see `News`.

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
