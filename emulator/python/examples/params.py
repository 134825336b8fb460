"""Parameters by name: read, set, refused, and compared with another ESC's."""

import siskin


def main() -> None:
    emulator = siskin.Emulator("bosso", escs=2, params={"CTL_RPM_MAX": 5000})
    params = emulator.params
    print(f"{len(params)} parameters; R is {params['MOT_R_MOHM']} mΩ, at most {params['CTL_RPM_MAX']:.0f} rpm")

    params.of(1)["CTL_RPM_MAX"] = 4000
    emulator.advance(0.4)
    emulator.throttle[:] = 1.0
    emulator.advance(2.0)
    print("full throttle:", *(f"{esc.rpm:.0f}" for esc in emulator.state), "rpm")

    try:
        params["MOT_POLE_PAIRS"] = 7
    except siskin.Error as error:
        print(error)


if __name__ == "__main__":
    main()
