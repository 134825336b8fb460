"""The Python module: scenarios and sweeps match the program's, whoever plays them."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from dask.distributed import Client, LocalCluster

import siskin
from emulator import run, scenario
from paths import PROGRAM, SCENARIOS

DRIVES = SCENARIOS / "random-drives.toml"
ALL = range(1, 1001)
FEW = range(1, 7)


@contextlib.contextmanager
def two_workers():
    """A cluster of two single-threaded worker processes, restarted when they die."""
    options = {"host": "127.0.0.1", "dashboard_address": None, "threads_per_worker": 1}
    with LocalCluster(n_workers=2, processes=True, **options) as cluster, Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def client():
    """A cluster that is left alone."""
    with two_workers() as client:
        yield client


@pytest.fixture
def grid(tmp_path):
    """Six runs of two seconds, two of which fail because they ask for less than is expected."""
    path = tmp_path / "grid.toml"
    path.write_text(
        """
        [bench]
        duration_s = 2.0
        [sweep]
        "signal.0.rpm" = [1500.0, 3000.0, 4000.0]
        "bench.bus" = ["24", "6s"]
        [random]
        "bench.initial_angle_deg" = [-180.0, 180.0]
        [[signal]]
        at_s = 0.1
        rpm = 3000.0
        [[window]]
        name = "end"
        t0_s = 1.9
        t1_s = 2.0
        [[expect]]
        window = "end"
        key = "rpm_mean"
        above = 1700.0
        """
    )
    return path


def of_program(path, table, *options, threads: int) -> bytes:
    """Returns the table that the program writes."""
    command = [PROGRAM, "scenario", path, "--table", table, "--json", *map(str, options)]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    ended = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert ended.returncode in (0, 1), ended.stderr
    return table.read_bytes()


def written(table: siskin.Table, path) -> bytes:
    table.to_csv(path)
    return path.read_bytes()


def test_a_scenario_is_the_program_s():
    _, summary = scenario(SCENARIOS / "steps.toml")
    outcome = siskin.scenario(SCENARIOS / "steps.toml")
    wall = {"wall_s", "sim_per_wall"}
    assert {k: v for k, v in outcome.summary.items() if k not in wall} == {
        k: v for k, v in summary.items() if k not in wall
    }
    assert outcome.held and outcome.faults == [] and outcome.trace_hash == summary["trace_hash"]
    name = summary["windows"][0]["name"]
    assert outcome.windows[name] == summary["windows"][0]


def test_keys_are_set_as_on_the_command_line():
    path = SCENARIOS / "half-throttle.toml"
    _, summary = scenario(path, "--seed", 7, "--set", "bench.load=none", "--set", "bench.offset_a=[0.1, 0.0, 0.0]")
    outcome = siskin.scenario(path, seed=7, **{"bench.load": "none", "bench.offset_a": [0.1, 0, 0]})
    assert outcome.trace_hash == summary["trace_hash"]
    assert outcome.trace_hash != siskin.scenario(path, seed=7).trace_hash


def test_what_the_motor_turns_on_with_is_told_beside_the_faults():
    outcome = siskin.scenario(SCENARIOS / "fault-phase-open.toml")
    assert (outcome.faults, outcome.warnings) == ([], ["phase open"])
    assert siskin.scenario(SCENARIOS / "half-throttle.toml").warnings == []


@pytest.mark.parametrize(
    "path, keys",
    [
        ("no-such.toml", {}),
        ("steps.toml", {"bench.load": "no-such"}),
        ("steps.toml", {"bench.noise_a": -1.0}),
        ("steps.toml", {"signal.99.rpm": 1.0}),
        ("steps.toml", {"params.NO_SUCH": 1.0}),
    ],
)
def test_errors_are_the_program_s(path, keys):
    for play in (siskin.scenario, siskin.sweep):
        with pytest.raises(siskin.Error) as raised:
            play(SCENARIOS / path, **keys)
        options = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
        ended = run("scenario", SCENARIOS / path, *options)
        assert ended.returncode == 2 and ended.stderr == f"siskin-emulator: {raised.value}\n"


def test_a_sweep_is_the_program_s_table(grid, tmp_path):
    wanted = of_program(grid, tmp_path / "program.csv", "--seeds", "3..4", threads=1)
    one, many = (siskin.sweep(grid, seeds=range(3, 5), threads=threads) for threads in (1, None))
    assert written(one, tmp_path / "one.csv") == written(many, tmp_path / "many.csv") == wanted
    assert one == many and len(one) == 12 and one.columns[:3] == ["seed", "bench.bus", "signal.0.rpm"]
    assert repr(one) == "<Table of 12 runs, 4 failed>"
    assert one[0]["seed"] == 3 and one[-1]["bench.bus"] == "6s"
    assert one["end.rpm_mean"].dtype == float and one["held"].dtype == bool and one["bench.bus"].dtype == object
    assert np.array_equal(one["held"], one["signal.0.rpm"] > 1500)
    assert one[2:4] == siskin.Table(list(one._rows[2:4])) != one
    with pytest.raises(KeyError, match="there is no column rpm"):
        one["rpm"]
    with pytest.raises(siskin.Error, match="must end in .csv or .parquet"):
        one.to_csv(tmp_path / "table.txt")


def test_a_fixed_key_is_not_swept(grid):
    table = siskin.sweep(grid, **{"signal.0.rpm": 3000.0})
    assert len(table) == 2 and set(table["signal.0.rpm"]) == {3000.0}


def test_seeds_are_any_sequence_of_consecutive_ones(grid):
    wanted = siskin.sweep(grid, seeds=range(1, 4))
    for seeds in ([1, 2, 3], (1, 2, 3), np.arange(1, 4)):
        assert siskin.sweep(grid, seeds=seeds) == wanted


def test_threads_are_as_many_as_there_is_work_for(grid):
    """Counted by the system while they play."""
    most = 0
    done = threading.Event()

    def look():
        nonlocal most
        while not done.wait(0.005):
            most = max(most, len(os.listdir("/proc/self/task")))

    watcher = threading.Thread(target=look)
    watcher.start()
    before = len(os.listdir("/proc/self/task"))
    table = siskin.sweep(grid, threads=10**30)
    done.set()
    watcher.join()
    assert len(table) == 6 and table == siskin.sweep(grid, threads=1)
    # Beside them the sweep's own thread, and those that read the file, one a processor, some of which still end.
    assert before < most <= before + 6 + 1 + os.cpu_count()
    for threads in (0, -1, 1.5, "2"):
        with pytest.raises(siskin.Error, match="give a whole number from 1"):
            siskin.sweep(grid, threads=threads)


def test_a_run_that_is_refused_is_a_row(grid):
    text = grid.read_text().replace("[random]", '"params.CTL_RPM_MIN" = [300.0, 7000.0]\n[random]')
    grid.write_text(text)
    table = siskin.sweep(grid)
    assert len(table) == 12 and table.columns[-2:] == ["held", "error"]
    refused = [row for row in table if row.get("error")]
    assert len(refused) == 6 and all(row["params.CTL_RPM_MIN"] == 7000 for row in refused)
    assert all("CTL_RPM_MIN" in row["error"] and row["held"] is False for row in refused)
    assert np.isnan(table["end.rpm_mean"]).sum() == 6


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "1"])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(siskin.Error, match="give a whole number from 0"):
        siskin.scenario(SCENARIOS / "steps.toml", seed=seed)


@pytest.mark.parametrize(
    "seeds",
    [range(5, 5), range(1, 9, 2), range(-1, 4), [], [1, 3], [2, 1], 5, "12", [2**64], range(1, 10**30, 2)],
)
def test_seeds_are_without_gaps(grid, seeds):
    with pytest.raises(siskin.Error, match="give consecutive seeds"):
        siskin.sweep(grid, seeds=seeds)


def test_a_cluster_gives_the_same_table(client, grid):
    alone, together = siskin.sweep(grid, seeds=FEW), siskin.sweep(grid, seeds=FEW, client=client)
    assert alone == together and len(together) == 6 * len(FEW)
    with pytest.raises(siskin.Error, match="bench.load"):
        siskin.sweep(grid, client=client, **{"bench.load": "no-such"})
    with pytest.raises(siskin.Error, match="give one of them"):
        siskin.sweep(grid, client=client, threads=2)


def test_a_worker_with_another_file_is_found_out(client, grid):
    part = {"path": grid, "ends": None, "overrides": {}, "text": "that of another"}
    future = client.submit(siskin._sweep._part, (0, 1), **part)
    with pytest.raises(siskin.Error, match="the file on this worker differs"):
        future.result()


def sweep_with_one_killed(client) -> siskin.Table:
    """Sweeps all drives with two workers, one of which is killed once some are done and others are not."""
    tables = []
    sweep = threading.Thread(target=lambda: tables.append(siskin.sweep(DRIVES, seeds=ALL, client=client)))
    before = client.run(os.getpid)
    sweep.start()
    tasks = client.cluster.scheduler.tasks

    def played() -> int:
        return sum(task.state == "memory" for task in tasks.copy().values())

    while played() < 10:
        assert sweep.is_alive()
        time.sleep(0.01)
    os.kill(next(iter(before.values())), signal.SIGKILL)
    assert played() < len(tasks), "in mid-sweep"
    sweep.join()
    after = client.run(os.getpid)
    assert len(set(before.values()) - set(after.values())) == 1, "that one has died"
    return tables[0]


def test_a_thousand_drives_give_one_table_though_a_worker_is_killed(tmp_path):
    wanted = of_program(DRIVES, tmp_path / "program.csv", "--seeds", f"{ALL[0]}..{ALL[-1]}", threads=1)
    assert len(wanted.splitlines()) == 1 + len(ALL)
    assert written(siskin.sweep(DRIVES, seeds=ALL), tmp_path / "cores.csv") == wanted
    with two_workers() as client:
        together = sweep_with_one_killed(client)
    assert written(together, tmp_path / "cluster.csv") == wanted


def test_ctrl_c_ends_a_sweep():
    script = f"""
import os, signal, threading, siskin
# A shell in the background hands on that interrupts are ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    siskin.sweep({str(DRIVES)!r}, seeds=range(1, 100001))
except KeyboardInterrupt:
    print("ended")
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert ended.stdout == "ended\n", ended.stderr
