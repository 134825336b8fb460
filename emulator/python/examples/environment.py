"""How the ESC and its motor respond to a gust, a weak pack and a hot day."""

import siskin


def tell(what: str, emulator: siskin.Emulator) -> None:
    emulator.advance(1.0)
    speeds = " and ".join(f"{esc.rpm:.0f} rpm with {esc.torque_nm:.3f} Nm" for esc in emulator.state)
    print(f"{what}: {speeds}")


def main() -> None:
    emulator = siskin.Emulator("bosso", escs=2, bus="6s")
    emulator.advance(0.4)
    emulator.throttle[:] = 0.6
    emulator.advance(2.0)

    tell("calm", emulator)
    emulator.environment(wind_rpm=[1500.0, None])
    tell("a wind through the disc of the first", emulator)
    emulator.environment(torque_nm=[None, -0.02])
    tell("and a brake on the second", emulator)

    emulator.environment(supply_v=20.0, supply_ohm=0.2, ambient_c=45.0)
    emulator.advance(10.0)
    state = emulator.state[0]
    print(f"a weak pack: {state.bus_v:.2f} V, told as {state.reported.bus_v:.2f} V; the board has {state.board_c:.0f} °C")


if __name__ == "__main__":
    main()
