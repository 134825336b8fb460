"""How the emulator refuses input that it cannot use: with one clear line and exit status 2."""

import random
import socket
import time

import pytest

from emulator import free_port, run

def refused(*arguments: object) -> str:
    """Runs with these arguments and returns the refusal's one line."""
    ended = run(*arguments, timeout=30.0)
    assert ended.returncode == 2, f"status {ended.returncode}: {ended.stdout} {ended.stderr}"
    assert ended.stdout == ""
    lines = ended.stderr.splitlines()
    assert len(lines) == 1, ended.stderr
    assert "panicked" not in lines[0]
    return lines[0]


def short_run(*options: str) -> list:
    """Returns a run of 10 ms on a free port, with these options overriding its own."""
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
        (["--bench", "tricycle"], "tricycle"),
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
        (["--speed", "lockstep", "--web", "127.0.0.1:0"], "no page is served in lockstep"),
        (["scenario", "/nowhere.toml"], "/nowhere.toml"),
        (["scenario", "x.toml", "--seeds", "9..1"], "9..1"),
        (["scenario", "x.toml", "--seeds", "1"], "--seeds"),
        (["scenario", "x.toml", "--seeds", "1..2", "--seed", "1"], "--seed"),
        (["scenario", "x.toml", "--set", "bench.seed"], "bench.seed"),
        (["plot", "/nowhere.csv", "-o", "x.svg"], "/nowhere.csv"),
        (["plot"], "<RECORD>"),
        (["plot"], "--output <PICTURE.svg|.png>"),
        (["reproduce"], "<PAPER>"),
        (["reproduce", "colton", "-o", "/proc/nobody"], "/proc/nobody"),
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
    """Returns the refusal of a storage file."""
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
        ("[bench]\nmotor = 'warp-drive'", "line 2: bench.motor: "),
        ("[bench]\nload = 'nowhere/load.toml'", "line 2: bench.load: "),
        ("[bench]\nseed = 1\n[bench.motor]\nR = -1.0\nL = 1e-5\nflux = 1e-3\npole_pairs = 7",
         "line 4: bench.motor.R: motor: R = -1"),
        # What nothing can meet, or nothing can miss.
        ("[[expect]]\nwindow = 'run'\nkey = 'faults'\nequals = nan", "line 4: expect.0.equals: NaN is no bound"),
        ("[[expect]]\nwindow = 'run'\nkey = 'faults'\nbelow = inf", "line 4: expect.0.below: inf is no bound"),
        ("[[expect]]\nwindow = 'run'\nkey = 'faults'\nequals = 0\nwithin = -1.0", "line 5: expect.0.within: -1 is less"),
        ("[[window]]\nname = 'a'\nt0_s = -inf\nt1_s = 1.0", "line 3: window.0.t0_s: the window a begins before"),
        ("[sweep]\n'expect.0.equals' = [nan]\n[[expect]]\nwindow = 'run'\nkey = 'faults'\nequals = 0",
         "line 2: expect.0.equals: NaN is no bound"),
        # For mOhm, uH, mWb and g cm^2.
        ("[bench]\nmotor = { R = 33.0, L = 1e-5, flux = 1e-3, pole_pairs = 7 }",
         "line 2: bench.motor.R: motor: R = 33 is out of range; give 0.001 to 10 ohm"),
        ("[bench]\nmotor = { R = 0.033, L = 12.0, flux = 1e-3, pole_pairs = 7 }",
         "line 2: bench.motor.L: motor: L = 12 is out of range; give 0.0000005 to 0.01 H"),
        ("[bench]\nmotor = { R = 0.033, L = 1e-5, flux = 0.32, pole_pairs = 7 }",
         "line 2: bench.motor.flux: motor: flux = 0.32 is out of range; give 0.00001 to 0.2 Wb"),
        ("[bench]\nmotor = { R = 0.033, L = 1e-5, flux = 1e-3, pole_pairs = 7, J = 25.0 }",
         "line 2: bench.motor.J: motor: J = 25 is out of range; give 0 to 1 kg m^2"),
        ("[bench]\nload = { c2 = 1e-8, J = 38.0 }", "line 2: bench.load.J: load: J = 38"),
        ("[bench]\nwire = 'pwm'", "line 2: bench.wire: 'pwm' is not a throttle signal; give one of servo, "),
        ("[bench]\nflux_capacitor = 1", "line 2: bench.flux_capacitor: unknown field"),
        ("[bench]\n\nduration_s = 'long'", "line 3: bench.duration_s: invalid type"),
        ("[bench]\nduration_s = -1.0", "line 2: bench.duration_s = -1"),
        ("[bench]\nduration_s = nan", "line 2: bench.duration_s"),
        ("[bench]\nscale = { R = 1.0, L = 1e9 }", "line 2: bench.scale.L"),
        ("[bench]\nbase = 'tricycle'", "line 2: bench.base: bench tricycle"),
        ("[bench]\nbase = 'scooter'\nmotor.warp = 9", "line 3: bench.motor.warp: "),
        ("[bench]\nbase = 'scooter'\nmotor.R = 9e9", "line 3: bench.motor.R: motor: R = 9"),
        ("[bench]\nbase = 'tricycle'\nmotor.R = 0.1", "line 2: bench.base: bench tricycle"),
        ("[bench]\nmotor = { R = 10.0, L = 5e-7, flux = 1e-3, pole_pairs = 7, saturation_a = 1.0 }",
         "line 2: R/L of a motor"),
        ("[bench]\nbus = { volts = 99.0 }", "line 2: bench.bus.volts: bus: volts = 99"),
        ("[bench]\nbus = { cells = 4, sinks = false }", "line 2: bench.bus: "),
        ("[bench]\nbus = { fuel_cells = 4 }", "line 2: bench.bus.fuel_cells: "),
        ("[bench]\nbus = '99x'", "line 2: bench.bus: bus 99x"),
        ("[bench]\nseed = 2\ndelay_periods = 0.3", "line 3: bench.delay_periods"),
        ("[params]\nNO_SUCH_NAME = 1", "line 2: params.NO_SUCH_NAME"),
        ("[params]\nLIM_PHASE_A = -1", "line 2: params.LIM_PHASE_A"),
        ("[[signal]]\nat_s = 0.0\nthrottle = 1.5", "line 3: signal.0.throttle: "),
        ("[[signal]]\nat_s = 0.0", "line 1: signal.0.throttle: "),
        ("[[signal]]\nat_s = 0.0\nrpm = 1e300", "line 3: signal.0.rpm: give a number within"),
        ("[[signal]]\nat_s = 0.0\nrpm = nan", "line 3: signal.0.rpm: give a number within"),
        ("[[signal]]\nat_s = 0.0\nrpm = 1.0\nshape = 'ramp'\nfor_s = 1e-300",
         "line 5: signal.0.for_s: "),
        ("[[signal]]\nat_s = 0.0\nrpm = 1.0\nshape = 'sine'\namplitude = 1e200\nfreq_hz = 1e200",
         "line 5: signal.0.amplitude: "),
        ("[[signal]]\nthrottle = 0.0", "line 1: signal.0: missing field `at_s`"),
        ("[[signal]]\nat_s = 1.0\nrpm = 1.0\n[[signal]]\nat_s = 0.0\nrpm = 1.0",
         "line 5: signal.1.at_s"),
        ("[[signal]]\nat_s = 0.0\nrpm = 1.0\nshape = 'round'", "line 4: signal.0.shape: "),
        ("[[signal]]\nat_s = 0.0\nrpm = 1.0\nshape = 'file'", "line 1: signal.0.path: "),
        ("[[signal]]\nat_s = 0.0\nrpm = 1.0\nshape = 'file'\npath = 'none.csv'",
         "line 5: signal.0.path: cannot read"),
        ("[[fault]]\nat_s = 0.0\nkind = 'reset'\n[[fault]]\nat_s = 0.0\nkind = 'gremlin'",
         "line 6: fault.1.kind: "),
        ("[[fault]]\nat_s = 0.0\nkind = 'noise'\nvalue = -1.0", "line 4: fault.0.value: "),
        ("[[fault]]\nat_s = 0.0\nkind = 'phase_open'", "line 1: fault.0.phase: "),
        ("[[window]]\nname = 'w'\nt0_s = 1.0\nt1_s = 0.5", "line 4: window.0.t1_s: the window w"),
        ("[[window]]\nname = 'w'\nt0_s = 0\nt1_s = 1\n[[window]]\nname = 'w'\nt0_s = 0\nt1_s = 1",
         "line 6: window.1.name: "),
        ("[bench]\nduration_s = 2.0\n[[fault]]\nat_s = 2.0\nkind = 'reset'",
         "line 4: fault.0.at_s: begins after the end of the scenario, duration_s = 2"),
        ("[[window]]\nname = 'w'\nt0_s = 0.0\nt1_s = 3.5",
         "line 4: window.0.t1_s: the window w ends after the end of the scenario, duration_s = 3"),
        ("[[window]]\nname = 'w'\nt0_s = 4.0\nt1_s = 5.0\n"
         "[[expect]]\nwindow = 'w'\nkey = 'starts'\nequals = 0", "line 4: window.0.t1_s: "),
        ("[[expect]]\nwindow = 'none'\nkey = 'rpm_mean'\nbelow = 1", "line 1: expect.0: "),
        ("[sweep]\n'bench.scale.Q' = [1.0]", "line 2: bench.scale.Q: "),
        ("[sweep]\n'benhc.noise_a' = [1.0]", "line 2: benhc.noise_a: "),
        ("[sweep]\n'signal.0.rpm' = [1.0]", "line 2: signal.0.rpm: "),
        ("[sweep]\n'params.NO_SUCH' = [1.0]", "line 2: params.NO_SUCH"),
        ("[bench]\nbus = 24.0\n[sweep]\n'bench.bus' = [24.0, '99x']", "line 4: bench.bus: bus 99x"),
        ("[random]\n'bench.noise_a' = [1.0, 0.0]", "line 2: bench.noise_a: "),
        ("[random]\n'bench.noise_a' = { off = [1.0] }", "line 2: random.bench.noise_a"),
        ("this is not TOML", "line 1: "),
        ("\0\x01\x02", "line 1: "),
    ],
)
def test_a_scenario_that_makes_no_sense_is_refused(tmp_path, text, names):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    line = refused("scenario", path)
    assert f"{path}: {names}" in line


@pytest.mark.parametrize(
    "entry, remedy",
    [
        ("[[fault]]\nat_s = 0.0\nkind = 'reset'\n", "fault: 10001 entries"),
        ("[[signal]]\nat_s = 0.0\nrpm = 0.0\n", "signal: 10001 entries"),
    ],
)
def test_a_scenario_has_so_many_entries_and_no_more(tmp_path, entry, remedy):
    path = tmp_path / "many.toml"
    path.write_text("[bench]\nduration_s = 0.001\n" + 10_000 * entry)
    began = time.monotonic()
    ended = run("scenario", path)
    assert ended.returncode == 0, ended.stderr
    # It used to take 39 s for ten times as many.
    assert time.monotonic() - began < 10.0
    path.write_text(10_001 * entry)
    line = refused("scenario", path)
    assert remedy in line and 'shape = "file"' in line


def test_a_scenario_that_is_too_long_is_refused_unread(tmp_path):
    path = tmp_path / "long.toml"
    path.write_text(100_000 * "[[signal]]\nat_s = 0.0\nrpm = 0.0\n")
    assert "more than 1000000 bytes" in refused("scenario", path)


def test_a_bad_line_of_a_course_is_named(tmp_path):
    path = tmp_path / "course.toml"
    path.write_text("[[signal]]\nat_s = 0.0\nrpm = 0.0\nshape = 'file'\npath = 'course.csv'")
    course = tmp_path / "course.csv"
    for text, names in [
        ("0.0,1.0\n1.0\n", "line 2: give seconds"),
        ("0.0,1.0\n1.0,1e300\n", "line 2: give seconds"),
        ("0.0,1.0\n1.0,1.0\n0.5,1.0\n", "line 3: the time does not rise"),
    ]:
        course.write_text(text)
        assert f"{path}: line 5: signal.0.path: {course}: {names}" in refused("scenario", path)


@pytest.mark.parametrize(
    "text, names",
    [
        ("bench = 3", "line 1: bench: invalid type"),
        ("[bench]\nbus = 24.0\nwarp = 9", "line 3: bench.warp: unknown field"),
        ("[bench]\n[bench.motor]\nR = 0.1", "missing field"),
        ("[bench]\nload = { c2 = -1.0 }", "line 2: bench.load.c2: "),
        ("[params]\nMOT_KV = 1\nNO_SUCH = 1", "line 2: params.MOT_KV: "),
        ("[params]\nMOT_R_MOHM = 'low'", "line 2: params.MOT_R_MOHM: invalid type"),
        ("[bench]\nseed = 3", "seed: "),
    ],
)
def test_a_bench_file_that_makes_no_sense_is_named(tmp_path, text, names):
    (tmp_path / "mine.toml").write_text(text)
    path = tmp_path / "scenario.toml"
    # What it leaves out comes from the bench in this folder.
    path.write_text("[bench]\nbase = 'mine.toml'\nload.c2 = 1e-7")
    line = refused("scenario", path)
    assert f"{path}: line 2: bench.base: bench file {tmp_path / 'mine.toml'}: " in line
    assert names in line


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


OBEYED = "\x1b[31m\x1b]0;title\x07\x00\x9b2J\u202e\u2066"
"""A colour, a title, NUL, a control of one byte, and marks that turn what follows around."""


def harmless(text: str) -> bool:
    """Whether a terminal obeys nothing of it but the ends of its lines."""
    return not any(c in text for c in OBEYED if not c.isprintable())


@pytest.mark.parametrize(
    "text",
    [
        "[bench]\nmotor = 'BAD'",
        "[params]\n'BAD' = 1.0",
        "BAD = 1.0",
        "signal = [{ at_s = 0.0, rpm = 0.0, shape = 'BAD' }]",
        "[[expect]]\nwindow = 'BAD'\nkey = 'faults'\nbelow = 1",
        "[[window]]\nname = 'BAD'\nt0_s = 2.0\nt1_s = 1.0",
    ],
)
def test_what_a_scenario_holds_does_not_command_the_terminal(tmp_path, text):
    path = tmp_path / "scenario.toml"
    # TOML takes them escaped, and as they are in a file that is none.
    escaped = "".join(c if c.isascii() and c.isprintable() else f"\\u{ord(c):04x}" for c in OBEYED)
    for bad in (escaped, OBEYED):
        path.write_text(text.replace("'BAD'", f'"{bad}"').replace("BAD", f'"{bad}"'))
        assert harmless(refused("scenario", path))


def test_names_of_files_and_windows_do_not_command_the_terminal(tmp_path):
    name = "\x1b[31m\u202e.csv"
    assert harmless(refused("plot", tmp_path / name, "-o", tmp_path / "picture.svg"))
    assert harmless(refused("scenario", tmp_path / name))
    path = tmp_path / "scenario.toml"
    path.write_text(
        'bench.duration_s = 0.01\nwindow = [{ name = "\\u001b[31m", t0_s = 0.0, t1_s = 0.01 }]\n'
        'expect = [{ window = "\\u001b[31m", key = "rpm_mean", below = 1.0 }]\n'
    )
    ended = run("scenario", path)
    assert ended.returncode == 0 and "\\u{1b}[31m" in ended.stdout
    assert harmless(ended.stdout)
