"""MAVLink without sockets: a ground station's mavutil connection, in simulated time."""

import siskin


def main() -> None:
    emulator = siskin.Emulator("bosso", escs=4, bus="6s")
    station = emulator.mavlink.connection()
    beat = station.recv_match(type="HEARTBEAT", blocking=True, timeout=30)
    print(f"component {beat.get_srcComponent()} is there at {emulator.time_s:.2f} s")

    emulator.throttle[:] = [0.4, 0.5, 0.6, 0.7]
    emulator.advance(2.0)
    # Zero throttle was not held: nothing turns.
    print([round(esc.rpm) for esc in emulator.state], [esc.armed for esc in emulator.state])
    emulator.throttle[:] = 0.0
    emulator.advance(0.4)
    emulator.throttle[:] = [0.4, 0.5, 0.6, 0.7]
    emulator.advance(2.0)
    emulator.mavlink.read()
    telemetry = station.recv_match(type="ESC_TELEMETRY_1_TO_4", blocking=True, timeout=30)
    print("telemetry:", *telemetry.rpm, "rpm;", "truth:", *(f"{esc.rpm:.0f}" for esc in emulator.state), "rpm")


if __name__ == "__main__":
    main()
