"""Files over MAVLink FTP, read with pymavlink's own client."""

import contextlib
import json
import lzma
import random
import re
import struct
import zlib

import pytest
from pymavlink import mavftp, mavutil
from pymavlink.mavftp import FtpError

import siskin_dialect as dialect
from emulator import OF_BENCH

PACK = "@PARAM/param.pck"
COMPONENT_METADATA = 397
COMPONENT_INFORMATION = 395
URI = re.compile(r"^mftp://(?:\[;comp=\d+\])?(/.+)$")
"""MAVLink FTP's URL scheme; QGroundControl accepts the same."""

# github.com/mavlink/mavlink, component_metadata/general.schema.json and parameter.schema.json: the fields allowed,
# with their types; the first ones of each are required.
GENERAL = {
    "version": int,
    "metadataTypes": list,
    "vendorName": str,
    "modelName": str,
    "firmwareVersion": str,
    "hardwareVersion": str,
}
GENERAL_REQUIRED = ("version", "metadataTypes")
METADATA_TYPE = {"type": int, "uri": str, "fileCrc": int}
COMP_METADATA_TYPE_PARAMETER = 1
NUMBER = (int, float)
PARAMETER = {
    "name": str,
    "type": str,
    "shortDesc": str,
    "longDesc": str,
    "units": str,
    "default": NUMBER,
    "decimalPlaces": int,
    "min": NUMBER,
    "max": NUMBER,
    "increment": NUMBER,
    "rebootRequired": bool,
    "group": str,
    "category": str,
    "volatile": bool,
    "values": list,
    "bitmask": list,
    "readOnly": bool,
}
# The schema requires the name; QGroundControl (FactMetaData::createFromJsonObject) also the type.
PARAMETER_REQUIRED = ("name", "type")


def crc32(data: bytes) -> int:
    """The CRC of MAVLink FTP and component metadata: from 0, and not inverted."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def single(value: float) -> float:
    """Rounds a number to a four-byte float."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def check(data: dict, fields: dict, required: tuple) -> None:
    """Asserts that an object follows the schema."""
    assert set(required) <= set(data), data
    for name, value in data.items():
        assert isinstance(value, fields[name]), (name, value)


class Files:
    """pymavlink's client for a component's files."""

    def __init__(self, port: int, system: int = 254):
        self.link = mavutil.mavlink_connection(
            f"tcp:127.0.0.1:{port}", source_system=system, source_component=190
        )
        self.client = mavftp.MAVFTP(self.link, 1, 1)

    def __enter__(self) -> "Files":
        return self

    def __exit__(self, *_) -> None:
        self.link.close()

    def get(self, path: str) -> tuple[int, bytes | None]:
        """Returns the result and the bytes of a file."""
        read = []
        self.client.cmd_get([path], callback=lambda file: read.append(file and file.read()))
        result = self.client.process_ftp_reply("Get", timeout=30)
        return result.error_code, read[0] if read else None

    def file(self, path: str) -> bytes:
        """Returns a file that must exist."""
        code, data = self.get(path)
        assert code == FtpError.Success, (path, code)
        return data


@pytest.fixture
def files(esc):
    """A client of `esc`'s emulator."""
    with Files(esc.emulator.port) as files:
        yield files


def metadata(esc, message: int):
    """Requests a message and returns it."""
    mark = esc.mark()
    accepted = esc.command(dialect.MAV_CMD_REQUEST_MESSAGE, message)
    assert accepted == dialect.MAV_RESULT_ACCEPTED
    kind = dialect.mavlink_map[message].msgname
    found = esc.wait(kind, since=mark)
    assert found is not None, f"no {kind}"
    return found


def test_the_parameters_are_those_of_the_list(esc, files):
    assert esc.set_param("MOT_L_UH", 12.5) == 12.5
    listed = esc.params()
    data = mavftp.MAVFTP.ftp_param_decode(files.file(PACK))
    assert {name.decode(): value for name, value, _ in data.params} == listed
    assert [name.decode() for name, _, _ in data.params] == list(listed)
    assert data.defaults is None

    data = mavftp.MAVFTP.ftp_param_decode(files.file(f"{PACK}?withdefaults=1"))
    assert {name.decode(): value for name, value, _ in data.params} == listed
    defaults = {name.decode(): value for name, value, _ in data.defaults}
    assert defaults["MOT_L_UH"] == 0.0
    changed = {name for name in listed if defaults[name] != listed[name]}
    assert changed - {"MOT_KV"} == set(OF_BENCH)
    assert {defaults[name] for name in OF_BENCH} == {0.0}

    # A part's header still counts all, so the decoder for whole files takes it.
    data = mavftp.MAVFTP.ftp_param_decode(files.file(f"{PACK}?start=10&count=3"))
    assert [name.decode() for name, _, _ in data.params] == list(listed)[10:13]


def test_the_metadata_describes_every_parameter(esc, files):
    told = metadata(esc, COMPONENT_METADATA)
    path = URI.match(told.uri).group(1)
    packed = files.file(path)
    assert crc32(packed) == told.file_crc
    general = json.loads(lzma.decompress(packed))
    check(general, GENERAL, GENERAL_REQUIRED)
    assert re.match(r"^\d+\.\d+\.\d+(\.\d+)?$", general["firmwareVersion"])
    [parameter_type] = general["metadataTypes"]
    check(parameter_type, METADATA_TYPE, ("type", "uri", "fileCrc"))
    assert parameter_type["type"] == COMP_METADATA_TYPE_PARAMETER

    packed = files.file(URI.match(parameter_type["uri"]).group(1))
    assert crc32(packed) == parameter_type["fileCrc"]
    parameter = json.loads(lzma.decompress(packed))
    assert set(parameter) == {"version", "parameters"}
    # QGroundControl refuses any other version.
    assert (general["version"], parameter["version"]) == (1, 1)

    listed = esc.params()
    described = {entry["name"]: entry for entry in parameter["parameters"]}
    assert list(described) == list(listed)
    for name, entry in described.items():
        check(entry, PARAMETER, PARAMETER_REQUIRED)
        assert re.match(r"^[.\-a-zA-Z0-9_{}]{1,16}$", name)
        # As PARAM_VALUE says for each.
        assert entry["type"] == "Float"
        assert entry["shortDesc"] and entry["group"]
        assert entry["min"] <= listed[name] <= entry["max"]
        if not entry.get("readOnly", False):
            # The emulator is fresh, on its default bench.
            assert single(entry["default"]) == (0.0 if name in OF_BENCH else listed[name]), name
        for choice in entry.get("values", ()):
            check(choice, {"value": NUMBER, "description": str}, ("value", "description"))
            assert entry["min"] <= choice["value"] <= entry["max"]
    assert described["MOT_KV"]["readOnly"]
    assert described["PWM_FREQ_HZ"]["rebootRequired"]
    assert described["MOT_L_UH"]["units"] == "uH"
    choices = {c["value"]: c["description"] for c in described["CTL_MODE"]["values"]}
    assert choices == {0: "speed", 1: "torque", 2: "voltage"}


def test_older_ground_stations_find_the_metadata_too(esc):
    told = metadata(esc, COMPONENT_METADATA)
    older = metadata(esc, COMPONENT_INFORMATION)
    assert older.general_metadata_uri == told.uri
    assert older.general_metadata_file_crc == told.file_crc
    assert (older.peripherals_metadata_uri, older.peripherals_metadata_file_crc) == ("", 0)
    capabilities = metadata(esc, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION).capabilities
    assert capabilities & dialect.MAV_PROTOCOL_CAPABILITY_FTP


def test_folders_are_listed_and_what_is_in_them_can_be_read(files):
    def walk(folder: str) -> dict[str, int]:
        result = files.client.cmd_list([folder])
        assert result.error_code == FtpError.Success
        found = {}
        for entry in result.directory_listing:
            path = f"{folder.rstrip('/')}/{entry.name}"
            found |= walk(path) if entry.is_dir else {path: entry.size_b}
        return found

    # The highest current and temperature still rise after power-up, and a file that is rewritten while it is read
    # ends the session: the reader opens it again.
    for _ in range(5):
        sizes = walk("/")
        assert set(sizes) == {
            "/general.json.xz",
            "/parameter.json.xz",
            f"/{PACK}",
            "/@SYS/faults.txt",
            "/@SYS/statistics.txt",
            "/@SYS/check.txt",
            "/@SYS/identify.txt",
            "/@SYS/faults.bin",
        }
        read = {path: files.get(path) for path in sizes}
        if all(code != FtpError.InvalidSession for code, _ in read.values()) and walk("/") == sizes:
            break
    assert {path: (code, len(data or b"")) for path, (code, data) in read.items()} == {
        path: (FtpError.Success, size) for path, size in sizes.items()
    }


def test_faults_are_told_in_words(files):
    assert files.file("@SYS/faults.txt") == b"Faults since the start: 0\n"


def test_what_is_not_served_is_refused(files):
    for path in ("nothing", "@SYS/nothing", f"{PACK}?start=200", "@ROMFS/x"):
        assert files.get(path) == (FtpError.FileNotFound, None), path
    assert files.client.cmd_rm([PACK]).error_code == FtpError.FileProtected
    assert files.client.cmd_crc(["nothing"]).error_code == FtpError.FileNotFound
    assert files.client.cmd_crc([PACK]).error_code == FtpError.Success


def test_files_are_whole_over_a_link_that_loses_a_fifth(files):
    whole = {path: files.file(path) for path in (PACK, "parameter.json.xz")}
    random.seed(1)
    # Share of what arrives at the client.
    files.client.ftp_settings.pkt_loss_rx = 20
    for path, data in whole.items():
        for _ in range(5):
            # The client tries three times to open a file and then gives up.
            tries = (files.get(path) for _ in range(5))
            assert next(read for code, read in tries if code == FtpError.Success) == data


def test_two_read_one_after_the_other(start):
    emulator = start()
    with contextlib.ExitStack() as clients:
        first, second = (
            clients.enter_context(Files(emulator.port, system)) for system in (253, 254)
        )
        data = first.file(PACK)
        assert second.file(PACK) == data
        # One that only opens a file keeps the other out.
        first.link.mav.file_transfer_protocol_send(
            0, 1, 1, mavftp.FTP_OP(9, 0, 4, len(PACK), 0, 0, 0, PACK.encode()).pack().ljust(251, b"\0")
        )
        assert first.link.recv_match(type="FILE_TRANSFER_PROTOCOL", blocking=True, timeout=10)
        assert second.get(PACK) == (FtpError.NoSessionsAvailable, None)
        first.client.cmd_cancel()
