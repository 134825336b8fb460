"""What each board's image may take, and which interrupts may preempt which."""

from dataclasses import dataclass

KB = 1024

MAVLINK = 15 * KB
"""What the MAVLink component may take of any flash, text and data, without the files that it serves and the
signatures."""


@dataclass(frozen=True)
class Region:
    """A memory, and how much of it an image may take."""

    name: str
    begin: int
    size: int
    limit: int

    def __contains__(self, address: int) -> bool:
        return self.begin <= address < self.begin + self.size


@dataclass(frozen=True)
class Board:
    """A board as in the firmware's linker scripts and `priority.rs`."""

    flash: Region
    memories: tuple[Region, ...]
    pwm: str
    """The PWM interrupt, alone at priority 0."""
    alarm: str | None
    """The gate driver's alarm, alone at priority 1. All others share one priority below."""


BOARDS = {
    "b-g431b-esc1": Board(
        # All but the store.
        flash=Region("flash", 0x0800_0000, 128 * KB, 124 * KB),
        memories=(
            # With the fault record, which the image for flying keeps.
            Region("CCM", 0x1000_0000, 10 * KB, 10 * KB),
            Region("SRAM", 0x2000_0000, 22 * KB, 19 * KB),
        ),
        pwm="ADC1_2",
        alarm=None,
    ),
    "vesc4-f405-r001": Board(
        # Two of its sectors, after the one with the vectors, are the store.
        flash=Region("flash", 0x0800_0000, 1024 * KB, (1024 - 32) * KB),
        memories=(Region("SRAM", 0x2000_0000, 128 * KB, 128 * KB),),
        pwm="ADC",
        alarm="EXTI15_10",
    ),
}
