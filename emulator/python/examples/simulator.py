"""A flight simulator's loop in steps of 1 ms: a quadrotor climbs on four ESCs and one pack."""

import siskin

MASS_KG = 0.5
GRAVITY_M_S2 = 9.81
# Thrust of a 5-inch propeller over the square of its speed, N/rpm²; an estimate.
THRUST = 1.3e-8
# Inflow when climbing, as the speed at which it would turn the propeller, rpm per m/s (a pitch of 4.5 inches).
INFLOW_RPM = 60 / 0.1143


def main() -> None:
    emulator = siskin.Emulator("quad-5-inch", escs=4)
    emulator.advance(0.4)
    assert all(esc.armed for esc in emulator.state)

    height_m, climb_m_s = 0.0, 0.0
    for step in range(2000):
        # In place of a flight controller: a climb of 1 m/s, once the motors have started.
        wanted = 0.35 if step < 500 else 0.45 + 0.1 * (1.0 - climb_m_s)
        emulator.throttle[:] = min(max(wanted, 0.0), 1.0)
        emulator.environment(wind_rpm=INFLOW_RPM * climb_m_s)
        emulator.advance(0.001)

        thrust_n = sum(THRUST * esc.rpm**2 for esc in emulator.state)
        climb_m_s += (thrust_n / MASS_KG - GRAVITY_M_S2) * 0.001
        if height_m <= 0.0:
            climb_m_s = max(climb_m_s, 0.0)
        height_m += climb_m_s * 0.001

    speeds = ", ".join(f"{esc.rpm:.0f}" for esc in emulator.state)
    print(f"{height_m:.2f} m after {emulator.time_s:.1f} s, {climb_m_s:.2f} m/s at {speeds} rpm")


if __name__ == "__main__":
    main()
