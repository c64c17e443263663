"""Draw a batch on a Slurm cluster: jobs are sent for workers, which draw, and are given back.

    python slurm.py --jobs 8 --cores 16 --memory 32GB --time 2:00:00 -- \
        render model.pt meshes/ -o drawings/ --timeout 300

Run it where you run sbatch: on a login node, better in a job of its own. What stands after -- is a
command line of strokestyle, to which --scheduler is added; its exit code is this one's. It begins
with the first job that Slurm starts; jobs that come later join. Stopped or cut off by its time, the
same command with --resume goes on.

Needs: pip install 'strokestyle[cluster]' dask-jobqueue. Where Dask's configuration names TLS
certificates (docs/batches.md), all talk by TLS: on a cluster that others use, have some.
"""

import argparse
import subprocess
import sys

try:
    import dask.config
    from dask_jobqueue import SLURMCluster
except ImportError as error:
    sys.exit(f"slurm.py: there is no {error.name} here: pip install dask-jobqueue distributed")


def options():
    """What is asked of Slurm, and the command line of strokestyle."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        usage="slurm.py [OPTION ...] -- render MODEL SHAPE ... -o OUT/ [...]",
    )
    parser.add_argument("--jobs", type=int, default=4, help="Slurm jobs, each one worker  [4]")
    parser.add_argument("--cores", type=int, default=8, help="shapes at a time in each job  [8]")
    parser.add_argument("--memory", default="16GB", help="of each job  [16GB]")
    parser.add_argument("--time", default="1:00:00", help="that each job may take  [1:00:00]")
    parser.add_argument("--queue", help="partition")
    parser.add_argument("--account", help="who pays")
    parser.add_argument("--interface", help="network that the nodes share, such as ib0")
    parser.add_argument("--also", action="append", default=[], help="more for #SBATCH, as a word")
    parser.add_argument("command", nargs="+", help="render ...")
    return parser.parse_args()


def main():
    asked = options()
    secured = dask.config.get("distributed.comm.tls.ca-file", None)
    with SLURMCluster(
        cores=asked.cores,  # a thread for each: it waits for the process that draws
        processes=1,
        memory=asked.memory,
        walltime=asked.time,
        queue=asked.queue,
        account=asked.account,
        interface=asked.interface,
        protocol="tls://" if secured else "tcp://",
        job_extra_directives=asked.also,
        scheduler_options={"dashboard_address": ":0"},  # any port: others have theirs there
    ) as cluster:
        cluster.scale(jobs=asked.jobs)
        command = ["strokestyle", *asked.command, "--scheduler", cluster.scheduler_address]
        return subprocess.run(command).returncode


if __name__ == "__main__":
    sys.exit(main())
