"""A sweep on a Dask cluster: here two processes on this machine, elsewhere whatever its scheduler reaches."""

import sys

from dask.distributed import Client, LocalCluster

import siskin


def main(path: str, seeds: str = "12") -> None:
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        # For a cluster that already runs: Client("tcp://head:8786").
        with Client(cluster) as client:
            together = siskin.sweep(path, seeds=range(1, int(seeds) + 1), client=client)
    alone = siskin.sweep(path, seeds=range(1, int(seeds) + 1))
    print(repr(together), "equal to this machine's, bit for bit:", together == alone)


if __name__ == "__main__":
    main(*sys.argv[1:])
