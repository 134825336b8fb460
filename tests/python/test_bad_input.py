"""What the emulator says to input that it cannot use: one clear line and exit status 2."""

import random
import socket

import pytest

from emulator import free_port, run

def refused(*arguments: object) -> str:
    """Runs with these arguments and gives the one line of the refusal."""
    ended = run(*arguments, timeout=30.0)
    assert ended.returncode == 2, f"status {ended.returncode}: {ended.stdout} {ended.stderr}"
    assert ended.stdout == ""
    lines = ended.stderr.splitlines()
    assert len(lines) == 1, ended.stderr
    assert "panicked" not in lines[0]
    return lines[0]


def short_run(*options: str) -> list:
    """A run of 10 ms on a free port, with these options in place of its own."""
    port = free_port(socket.SOCK_DGRAM)
    usual = {
        "--speed": "max",
        "--duration": "0.01",
        "--storage": "none",
        "--mavlink": "none",
        "--signal": f"udp:127.0.0.1:{port}",
    }
    kept = [part for pair in usual.items() if pair[0] not in options for part in pair]
    return [*kept, *options]


@pytest.mark.parametrize(
    "arguments, names",
    [
        (["--warp"], "--warp"),
        (["fly"], "fly"),
        (["--motor", "warp-drive"], "warp-drive"),
        (["--load", "anvil"], "anvil"),
        (["--bus", "9s9"], "9s9"),
        (["--bus", "-3"], "-3"),
        (["--bus", "nan"], "nan"),
        (["--speed", "fast"], "fast"),
        (["--speed", "0"], "0"),
        (["--duration", "-1"], "-1"),
        (["--seed", "x"], "x"),
        (["--mavlink", "carrier-pigeon:1"], "carrier-pigeon"),
        (["--mavlink", "tcpin:127.0.0.1:99999"], "99999"),
        (["--signal", "tcp:127.0.0.1:1"], "tcp:127.0.0.1:1"),
        (["--param", "NO_SUCH_NAME=1"], "NO_SUCH_NAME"),
        (["--param", "MOT_STOP"], "MOT_STOP"),
        (["--param", "MOT_STOP=7"], "MOT_STOP"),
        (["--param", "MOT_STOP=nan"], "MOT_STOP"),
        (["--param", "MOT_KV=100"], "MOT_KV"),
        (["--record", "/nowhere/at/all.csv"], "/nowhere/at/all.csv"),
        (["scenario", "/nowhere.toml"], "/nowhere.toml"),
        (["scenario", "x.toml", "--seeds", "9..1"], "9..1"),
        (["scenario", "x.toml", "--seeds", "1"], "--seeds"),
        (["scenario", "x.toml", "--seeds", "1..2", "--seed", "1"], "--seed"),
        (["scenario", "x.toml", "--set", "bench.seed"], "bench.seed"),
        (["plot", "/nowhere.csv", "-o", "x.svg"], "/nowhere.csv"),
    ],
)
def test_a_word_that_means_nothing_is_named(arguments, names):
    if arguments[0].startswith("--"):
        arguments = short_run(*arguments)
    assert names in refused(*arguments)


def test_a_taken_mavlink_port_is_named():
    with socket.create_server(("127.0.0.1", 0)) as holder:
        port = holder.getsockname()[1]
        line = refused(*short_run("--mavlink", f"tcpin:127.0.0.1:{port}"))
        assert str(port) in line and "taken" in line


def test_a_taken_throttle_port_is_named():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        port = holder.getsockname()[1]
        line = refused(*short_run("--signal", f"udp:127.0.0.1:{port}"))
        assert str(port) in line and "taken" in line


def storage(path) -> str:
    """The refusal of a storage file."""
    return refused(*short_run("--storage", str(path)))


def test_a_storage_path_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert "file/flash.bin" in storage(tmp_path / "file" / "flash.bin")
    assert str(tmp_path) in storage(tmp_path)
    assert "/proc/nobody" in storage("/proc/nobody/flash.bin")


@pytest.mark.parametrize("content", [b"not a flash image", bytes(100), bytes(1 << 20)])
def test_a_file_that_is_no_storage_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "flash.bin"
    path.write_bytes(content)
    storage(path)
    assert path.read_bytes() == content


@pytest.mark.parametrize("seed", range(8))
def test_a_storage_that_is_all_noise_is_refused_and_left_alone(tmp_path, start, seed):
    path = tmp_path / "flash.bin"
    start(storage=path).kill()
    noise = random.Random(seed).randbytes(path.stat().st_size)
    path.write_bytes(noise)
    storage(path)
    assert path.read_bytes() == noise


@pytest.mark.parametrize(
    "text, names",
    [
        ("[bench]\nmotor = 'warp-drive'", "warp-drive"),
        ("[bench]\nflux_capacitor = 1", "flux_capacitor"),
        ("[bench]\nduration_s = -1.0", "duration_s"),
        ("[bench]\nduration_s = nan", "duration_s"),
        ("[bench]\nbus = '99x'", "99x"),
        ("[params]\nNO_SUCH_NAME = 1", "NO_SUCH_NAME"),
        ("[params]\nLIM_PHASE_A = -1", "LIM_PHASE_A"),
        ("[[signal]]\nat_s = 0.0\nthrottle = 1.5", "throttle"),
        ("[[signal]]\nat_s = 0.0", "throttle"),
        ("[[window]]\nname = 'w'\nt0_s = 1.0\nt1_s = 0.5", "w"),
        ("[[expect]]\nwindow = 'none'\nkey = 'rpm_mean'\nbelow = 1", "none"),
        ("[sweep]\n'bench.scale.Q' = [1.0]", "bench.scale.Q"),
        ("[sweep]\n'benhc.noise_a' = [1.0]", "benhc.noise_a"),
        ("[sweep]\n'signal.0.rpm' = [1.0]", "signal.0.rpm"),
        ("[sweep]\n'params.NO_SUCH' = [1.0]", "params.NO_SUCH=1.0"),
        ("[sweep]\n'bench.bus' = ['99x']", "99x"),
        ("[random]\n'bench.noise_a' = [1.0, 0.0]", "bench.noise_a"),
        ("[random]\n'bench.noise_a' = { off = [1.0] }", "of = [...]"),
        ("this is not TOML", ""),
        ("\0\x01\x02", ""),
    ],
)
def test_a_scenario_that_makes_no_sense_is_refused(tmp_path, text, names):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    line = refused("scenario", path)
    assert str(path) in line and names in line


def test_several_runs_are_not_recorded(tmp_path):
    path = tmp_path / "swept.toml"
    path.write_text("[sweep]\n'bench.noise_a' = [0.0, 0.1]")
    record = tmp_path / "record.csv"
    assert "--record" in refused("scenario", path, "--record", record)
    assert not record.exists()


def test_a_key_that_is_set_wrongly_is_named(tmp_path):
    path = tmp_path / "empty.toml"
    path.write_text("")
    assert "bench.nose_a" in refused("scenario", path, "--set", "bench.nose_a=1.0")


def test_a_scenario_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(b"\xff\xfe\x00bench")
    assert str(path) in refused("scenario", path)
