"""A propeller strike, a broken throttle wire, and a motor that runs again once it is mended."""

import siskin


def main() -> None:
    emulator = siskin.Emulator("bosso", escs=2)
    emulator.advance(0.4)
    emulator.throttle[:] = 0.5
    emulator.advance(2.0)

    emulator.faults.inject(0, "strike", value=-0.3, for_s=0.05)
    emulator.faults.inject(1, "signal_loss", for_s=0.3)
    print("now:", *emulator.faults)
    emulator.advance(0.3)
    for index, esc in enumerate(emulator.state):
        print(f"ESC {index}: {esc.rpm:.0f} rpm, {esc.phase}, armed: {esc.armed}, faults: {esc.faults}")

    # A signal that comes back with open throttle turns nothing: it must be zero first.
    emulator.faults.mend()
    emulator.throttle[1] = 0.0
    emulator.advance(1.5)
    emulator.throttle[1] = 0.5
    emulator.advance(2.0)
    print("mended:", *(f"{esc.rpm:.0f}" for esc in emulator.state), "rpm")


if __name__ == "__main__":
    main()
