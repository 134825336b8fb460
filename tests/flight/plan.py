"""What a pilot flies, and what happens to him: the base of the plans, in which nothing happens."""

from body import Body
from quadrotor import CALM, PACK

LOW, HIGH = 1000, 2000


class Pilot:
    """Sees his height, and flies it by a simple loop on the throttle stick."""

    STIFF, DAMP, LEARN = 0.35, 0.18, 0.30
    """Share of the stick's travel per metre, per metre per second, and per metre in a second."""
    FIRST = 0.3
    LEAST, MOST = 0.06, 0.9

    def __init__(self):
        self.learned = self.FIRST

    def throttle(self, height_m: float, climb_m_s: float, wanted_m: float, rises_m_s: float, seconds: float) -> float:
        """Returns the stick for a wanted height, which changes at a speed; seconds since the last time."""
        miss = wanted_m - height_m
        self.learned += self.LEARN * miss * seconds
        stick = self.learned + self.STIFF * miss + self.DAMP * (rises_m_s - climb_m_s)
        return min(self.MOST, max(self.LEAST, stick))


class Plan:
    """A flight: what the sticks do a hundred times a second, what blows, sags and breaks, and what is judged of it.

    Times are in seconds since the start.
    """

    EVERY_NS = 10_000_000
    """Between two moves of the sticks."""
    ARM_S, TAKE_OFF_S, DISARM_S, END_S = 1.9, 2.3, 19.0, 20.0
    HEIGHT_M, CLIMB_M_S = 1.5, 1.0
    STARTS = 1
    """How often each motor starts."""
    STEADY: tuple[tuple[float, float], ...] = ()
    """When it hovers, and an ESC's replies are not off by their age."""
    FLIES = (0.0, 0.0)
    """When it is in the air."""

    def __init__(self):
        self.pilot = Pilot()

    def sticks(self, now_s: float, height_m: float, climb_m_s: float) -> list[int]:
        """Returns the channels in us: roll, pitch, throttle, yaw, the switches for arming and for angle mode."""
        throttle = self.throttle(now_s, height_m, climb_m_s)
        armed = HIGH if self.is_armed(now_s) else LOW
        roll = 1500 + round(500 * self.roll(now_s))
        return [roll, 1500, LOW + round(1000 * throttle), 1500, armed, HIGH, *[LOW] * 10]

    def is_armed(self, now_s: float) -> bool:
        return self.ARM_S <= now_s < self.DISARM_S

    def roll(self, now_s: float) -> float:
        """Returns the roll stick, -1 to 1."""
        return 0.0

    def throttle(self, now_s: float, height_m: float, climb_m_s: float) -> float:
        """Returns the throttle stick, 0 to 1."""
        raise NotImplementedError

    def held(self, height_m: float, climb_m_s: float, wanted_m: float, rises_m_s: float = 0.0) -> float:
        """Returns the throttle stick of a pilot who holds a height."""
        return self.pilot.throttle(height_m, climb_m_s, wanted_m, rises_m_s, self.EVERY_NS * 1e-9)

    def risen(self, now_s: float) -> tuple[float, float]:
        """Returns the height that a take-off has reached, and how fast it changes."""
        up = Body.STANDS + self.CLIMB_M_S * (now_s - self.TAKE_OFF_S)
        return (up, self.CLIMB_M_S) if up < self.HEIGHT_M else (self.HEIGHT_M, 0.0)

    def wind(self, now_s: float) -> tuple[float, float, float]:
        """North, west and up, m/s."""
        return CALM

    def pack(self, now_s: float) -> tuple[float, float]:
        """The pack's voltage without load, and its resistance in ohm."""
        return PACK

    def struck(self, now_s: float) -> list[float]:
        """Returns the torque that strikes each shaft, Nm."""
        return [0.0] * 4

    def silent(self, now_s: float, esc: int) -> bool:
        """Returns whether the wire to this ESC is broken."""
        return False

    def spans(self) -> list[tuple[str, float, float]]:
        """Returns what goes on, from when to when; of two at a time the first counts."""
        return []

    def event(self, now_s: float) -> str:
        """Returns what is going on at this time, for a picture."""
        return next((name for name, begin, end in self.spans() if begin <= now_s < end), "")

    def breaks(self, now_s: float) -> bool:
        """Returns whether a propeller is struck, or a wire silent."""
        return any(self.struck(now_s)) or any(self.silent(now_s, esc) for esc in range(4))

    def judge(self, verdict, rows: list[dict]) -> None:
        """Adds this flight's own figures to a verdict."""
        raise NotImplementedError
