"""A start, control period by control period, as a numpy array."""

import numpy as np

import siskin


def main() -> None:
    emulator = siskin.Emulator("bosso", escs=1, record=True)
    emulator.advance(0.4)
    emulator.throttle[0] = 0.5
    emulator.advance(1.6)

    rows = emulator.record()
    print(f"{len(rows)} control periods with {', '.join(rows.dtype.names or ())}")
    for phase in np.unique(rows["phase"]):
        of_phase = rows[rows["phase"] == phase]
        first_s, last_s = of_phase["t_s"][[0, -1]]
        print(f"{siskin.PHASES[phase]}: {first_s:.3f} to {last_s:.3f} s, at most {of_phase['rpm'].max():.0f} rpm")
    run = rows[rows["t_s"] > 1.5]
    print(f"angle error {np.abs(run['angle_error_deg']).mean():.2f}°, {np.sqrt((run['i_a_a'] ** 2).mean()):.2f} A rms")


if __name__ == "__main__":
    main()
