"""`siskin` with a signing key, against the emulator."""

import hashlib
import json
import subprocess
import time

import pytest

from emulator import Emulator
from paths import TOOL

NAME = "LIM_PHASE_A"


class Owner:
    """The tool, with a key's file or without."""

    def __init__(self, emulator: Emulator):
        self.endpoint = f"tcp:127.0.0.1:{emulator.port}"

    def run(self, *arguments: object, key=None, typed: str = "") -> subprocess.CompletedProcess:
        sign = ("--sign-key", key) if key else ()
        command = [TOOL, "--connect", self.endpoint, *sign, *arguments]
        command = [str(word) for word in command]
        return subprocess.run(command, input=typed, capture_output=True, text=True, timeout=60)

    def done(self, *arguments: object, **options) -> str:
        ended = self.run(*arguments, **options)
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def refused(self, *arguments: object, status: int = 1, **options) -> str:
        ended = self.run(*arguments, **options)
        assert ended.returncode == status, ended.stdout
        return ended.stderr

    def set(self, value: float, key=None) -> None:
        self.done("params", "set", NAME, value, key=key)
        assert self.value() == value

    def value(self) -> float:
        return json.loads(self.done("params", "get", "--json", NAME))[NAME]


@pytest.fixture
def stored(start, tmp_path):
    """Starts emulators with the same storage, one after another."""
    return lambda: start(storage=tmp_path / "flash")


@pytest.fixture
def keys(tmp_path):
    """Two keys' files."""
    for name in ("one", "two"):
        made = subprocess.run([str(TOOL), "key", "new", tmp_path / name], capture_output=True)
        assert made.returncode == 0, made.stderr
    return tmp_path / "one", tmp_path / "two"


def test_the_owner_of_a_key_is_obeyed_and_nobody_else(stored, keys):
    key, other = keys
    emulator = stored()
    owner = Owner(emulator)
    line = owner.refused("params", "set", NAME, 14, key=key)
    assert "it has no key" in line and "siskin key set FILE" in line and line.count("\n") == 1
    given = owner.done("key", "set", key)
    assert f"--sign-key {key}" in given and given.endswith("stored\n")
    assert owner.done("key", "set", key) == "the ESC has this key already\n"
    for value in (14.0, 15.0, 16.0):
        owner.set(value, key)
    # Others read, and are told why they change nothing.
    assert "give --sign-key FILE" in owner.refused("params", "set", NAME, 13)
    assert "--sign-key FILE" in owner.refused("check")
    assert owner.value() == 16.0
    line = owner.refused("params", "get", NAME, key=other)
    assert "signed with another key" in line and line.count("\n") == 1
    assert owner.done("check", key=key)
    assert len(owner.done("monitor", "--count", 2, key=key).splitlines()) >= 2
    assert owner.done("params", "describe", NAME, key=key)
    # Neither side forgets, and the next run's timestamps are later than the last one's.
    emulator.kill()
    owner = Owner(stored())
    assert owner.value() == 16.0
    owner.set(17.0, key)
    # Another key takes its place only with the first.
    assert "has another one already" in owner.refused("key", "set", other)
    owner.done("key", "set", other, key=key)
    owner.set(18.0, other)
    assert "another key" in owner.refused("params", "set", NAME, 13, key=key)
    assert "--sign-key FILE" in owner.refused("key", "remove", status=2)
    assert "no key any more" in owner.done("key", "remove", key=other)
    owner.set(19.0)


def test_a_key_of_a_passphrase_is_the_ground_stations(start, tmp_path):
    emulator = start()
    owner = Owner(emulator)
    path = tmp_path / "key"
    owner.done("key", "new", "--passphrase", path, typed="correct horse\n")
    # Without a file for the flash it is in force, and the tool says that it is not stored.
    line = owner.refused("key", "set", path)
    assert "storage: none" in line
    with emulator.connect() as esc:
        signing = esc.codec.signing
        signing.secret_key = hashlib.sha256(b"correct horse").digest()
        signing.timestamp = int((time.time() - 1_420_070_400) * 100_000)
        signing.sign_outgoing = True
        signing.allow_unsigned_callback = lambda *_: True
        esc.set_param(NAME, 12.0)
    assert owner.value() == 12.0
    owner.set(13.0, path)


def test_a_file_that_is_no_key_is_one_line(start, tmp_path):
    owner = Owner(start())
    (tmp_path / "text").write_text("key 1\n")
    for path, words in [("text", "is no signing key"), ("nothing", "No such file")]:
        for arguments in (("params", "list"), ("key", "set", tmp_path / path)):
            key = tmp_path / path if arguments[0] == "params" else None
            line = owner.refused(*arguments, key=key, status=2)
            assert str(tmp_path / path) in line and words in line and line.count("\n") == 1
    line = owner.refused("key", "new", tmp_path / "text", status=2)
    assert "exists" in line
    assert "standard input" in owner.refused("key", "new", "--passphrase", tmp_path / "new", status=2)
    assert not (tmp_path / "new").exists()
