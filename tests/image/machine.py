"""What one function does: the stack that it takes, whom it calls, which addresses it uses."""

from dataclasses import dataclass, field

import capstone
from capstone import arm

from image import Function, Image, Unreadable

DISASSEMBLER = capstone.Cs(
    capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS
)
DISASSEMBLER.detail = True

LARGEST_FRAME = 1 << 16
"""More than any function of a small chip takes, bytes: beyond it is a loop that pushes."""


@dataclass(frozen=True)
class Call:
    """A call, or a jump into another function."""

    site: int
    depth: int
    """Stack in use there, bytes."""
    target: int | None
    """`None` if it is only known at run time."""


@dataclass
class Code:
    """What one function does."""

    frame: int = 0
    """Most stack that it takes itself, bytes."""
    calls: list[Call] = field(default_factory=list)
    uses: dict[int, int] = field(default_factory=dict)
    """Addresses that it holds, by the place of each: of functions, odd, and of data."""
    called: set[int] = field(default_factory=set)
    """Places of those that it calls: code built for size calls through a register."""

    def held(self) -> set[int]:
        """Returns addresses that it holds other than just to call them."""
        return {value for place, value in self.uses.items() if place not in self.called}


@dataclass(frozen=True)
class Pointer:
    """A register's value: this many bytes below the stack pointer at entry."""

    depth: int


@dataclass(frozen=True)
class Number:
    """A register's value, and whether it is an address from the linker."""

    value: int
    is_address: bool
    place: int = field(default=0, compare=False)
    """Where an address is stored."""


def code_of(image: Image, function: Function) -> Code:
    """Follows every path through a function."""
    instructions = {}
    for begin, end in image.code_ranges(function):
        for instruction in DISASSEMBLER.disasm(image.read(begin, end - begin), begin):
            instructions[instruction.address] = instruction
    walk = Walk(image, function, instructions)
    walk.run()
    return walk.code


class Walk:
    """The paths through a function: at each instruction the stack depth and what is known about the registers."""

    def __init__(self, image: Image, function: Function, instructions: dict):
        self.image, self.function, self.instructions = image, function, instructions
        self.constants = {place for each in instructions.values() if (place := constant_place(each)) is not None}
        self.code = Code()
        self.seen = {}
        self.calls = {}
        self.open = [(function.begin, 0, {})]

    def run(self):
        while self.open:
            address, depth, registers = self.open.pop()
            known = self.seen.get(address)
            if known is not None:
                # Where paths meet, the deeper one counts, and what both agree on.
                deepest = max(depth, known[0])
                common = {r: v for r, v in known[1].items() if registers.get(r) == v}
                if (deepest, common) == known:
                    continue
                depth, registers = deepest, common
            if depth > LARGEST_FRAME:
                self.fail(address, "takes stack without end")
            self.seen[address] = depth, registers
            instruction = self.instructions.get(address)
            if instruction is None:
                self.fail(address, "is no instruction")
            self.step(instruction, depth, dict(registers))
        self.code.calls = list(self.calls.values())

    def fail(self, address: int, why: str):
        raise Unreadable(f"{address:#x} in {self.function.name}: {why}")

    def go(self, address: int, depth: int, registers: dict):
        """Continues there, which may be in another function."""
        if self.function.begin <= address < self.function.end:
            self.open.append((address, depth, registers))
        else:
            self.call(address, depth, address)

    def come_back(self, address: int, depth: int, registers: dict):
        """Continues after a call. One that does not return is followed by data, the next function, or padding."""
        behind = self.instructions.get(address)
        if behind and behind.mnemonic.startswith("nop"):
            behind = self.instructions.get(address + behind.size)
        if behind:
            self.go(address, depth, registers)

    def known(self, registers: dict, register: int) -> int | None:
        """Returns the function that a register holds. The linker's own veneers have no relocation."""
        value = registers.get(register)
        if isinstance(value, Number) and value.value & ~1 in self.image.functions:
            self.code.called.add(value.place)
            return value.value & ~1
        return None

    def call(self, site: int, depth: int, target: int | None):
        self.calls[site, depth, target] = Call(site, depth, target)

    def step(self, instruction, depth: int, registers: dict):
        after = instruction.address + instruction.size
        conditional = instruction.cc not in (arm.ARM_CC_AL, arm.ARM_CC_INVALID)
        operands = instruction.operands
        kind = instruction.id
        if kind == arm.ARM_INS_BL:
            self.call(instruction.address, depth, operands[0].imm)
            self.come_back(after, depth, kept(registers))
        elif kind == arm.ARM_INS_BLX:
            self.call(instruction.address, depth, self.known(registers, operands[0].reg))
            self.come_back(after, depth, kept(registers))
        elif kind in (arm.ARM_INS_CBZ, arm.ARM_INS_CBNZ):
            self.go(operands[1].imm, depth, registers)
            self.go(after, depth, registers)
        elif kind == arm.ARM_INS_B:
            self.go(operands[0].imm, depth, registers)
            if conditional:
                self.go(after, depth, registers)
        elif kind in (arm.ARM_INS_TBB, arm.ARM_INS_TBH):
            for target in self.table(instruction):
                self.go(target, depth, registers)
        elif kind in (arm.ARM_INS_UDF, arm.ARM_INS_TRAP):
            pass
        elif self.leaves(instruction):
            if kind == arm.ARM_INS_BX and operands[0].reg != arm.ARM_REG_LR:
                target = self.known(registers, operands[0].reg)
                self.call(instruction.address, depth, target)
            if conditional:
                self.go(after, depth, registers)
        else:
            depth = self.change(instruction, depth, registers)
            self.code.frame = max(self.code.frame, depth)
            self.go(after, depth, registers)

    def leaves(self, instruction) -> bool:
        """Returns whether it writes the program counter."""
        _, written = instruction.regs_access()
        return instruction.id == arm.ARM_INS_BX or arm.ARM_REG_PC in written

    def table(self, instruction) -> list[int]:
        """Returns where a jump table leads: up to the next instruction or constant, and within the function."""
        width = 1 if instruction.id == arm.ARM_INS_TBB else 2
        base = instruction.address + 4
        later = [address for address in (*self.instructions, *self.constants) if address >= base]
        end = min(later, default=self.function.end)
        data = self.image.read(base, end - base)
        entries = [data[i : i + width] for i in range(0, len(data) - width + 1, width)]
        targets = {base + 2 * int.from_bytes(entry, "little") for entry in entries}
        # A zero that pads to a whole word leads to the table itself.
        return sorted(target for target in targets if target in self.instructions)

    def change(self, instruction, depth: int, registers: dict) -> int:
        """Applies an instruction to the registers; returns the stack depth after it."""
        sp = arm.ARM_REG_SP
        before = {**registers, sp: Pointer(depth)}
        value = self.result(instruction, before)
        operands = instruction.operands
        _, written = instruction.regs_access()
        for register in written:
            registers.pop(register, None)
        # The disassembler does not count it for these two.
        if sp not in written and instruction.id not in (arm.ARM_INS_VPUSH, arm.ARM_INS_VPOP):
            if value is not None and operands[0].type == arm.ARM_OP_REG:
                registers[operands[0].reg] = value
            return depth
        moved = stack_taken(instruction)
        if moved is not None:
            return depth + moved
        if isinstance(value, Pointer) and operands[0].reg == sp:
            return value.depth
        self.fail(instruction.address, f"not understood: {instruction.mnemonic} {instruction.op_str}")

    def result(self, instruction, registers: dict):
        """Returns what it puts into its first register, if that can be determined."""
        kind, operands = instruction.id, instruction.operands
        if kind == arm.ARM_INS_LDR and operands[1].type == arm.ARM_OP_MEM:
            return self.literal(instruction)
        if kind in (arm.ARM_INS_MOV, arm.ARM_INS_MOVW) and len(operands) == 2:
            if operands[1].type == arm.ARM_OP_REG:
                return registers.get(operands[1].reg)
            return Number(operands[1].imm & 0xFFFF_FFFF, False)
        if kind == arm.ARM_INS_MOVT:
            low = registers.get(operands[0].reg)
            if isinstance(low, Number):
                value = low.value & 0xFFFF | operands[1].imm << 16
                return self.number(value, instruction.address)
        if kind == arm.ARM_INS_BFC:
            # It aligns a copy of the stack pointer downwards.
            pointer = registers.get(operands[0].reg)
            if isinstance(pointer, Pointer) and operands[1].imm == 0:
                return Pointer(pointer.depth + (1 << operands[2].imm))
        if kind in (arm.ARM_INS_ADD, arm.ARM_INS_ADDW, arm.ARM_INS_SUB, arm.ARM_INS_SUBW):
            return sum_of(operands, registers, kind in (arm.ARM_INS_SUB, arm.ARM_INS_SUBW))
        return None

    def literal(self, instruction):
        place = constant_place(instruction)
        return None if place is None else self.number(self.image.word(place), place)

    def number(self, value: int, place: int) -> Number:
        is_address = place in self.image.addresses
        if is_address:
            self.code.uses[place] = value
        return Number(value, is_address, place)


def constant_place(instruction) -> int | None:
    """Returns where the constant is that it loads."""
    memory = next((operand.mem for operand in instruction.operands if operand.type == arm.ARM_OP_MEM), None)
    if memory is None or memory.base != arm.ARM_REG_PC or memory.index:
        return None
    return (instruction.address & ~3) + 4 + memory.disp


def kept(registers: dict) -> dict:
    """Returns what a called function preserves."""
    lost = (arm.ARM_REG_R0, arm.ARM_REG_R1, arm.ARM_REG_R2, arm.ARM_REG_R3, arm.ARM_REG_R12)
    return {register: value for register, value in registers.items() if register not in lost}


def sum_of(operands, registers: dict, subtract: bool):
    """Returns an address in the stack, moved by a number."""
    source, moved = operands[-2], operands[-1]
    base = registers.get(source.reg)
    if moved.type == arm.ARM_OP_REG:
        number = registers.get(moved.reg)
        distance = number.value if isinstance(number, Number) else None
    else:
        distance = moved.imm
    if not isinstance(base, Pointer) or distance is None:
        return None
    return Pointer(base.depth + (distance if subtract else -distance))


def stack_taken(instruction) -> int | None:
    """Returns the bytes that an instruction pushes, negative for pops; `None` for others."""
    kind, operands = instruction.id, instruction.operands
    if kind in (arm.ARM_INS_PUSH, arm.ARM_INS_STMDB):
        return bytes_of(operands[kind == arm.ARM_INS_STMDB :])
    if kind in (arm.ARM_INS_POP, arm.ARM_INS_LDM):
        return -bytes_of(operands[kind == arm.ARM_INS_LDM :])
    if kind == arm.ARM_INS_VPUSH:
        return bytes_of(operands)
    if kind == arm.ARM_INS_VPOP:
        return -bytes_of(operands)
    if kind in (arm.ARM_INS_STR, arm.ARM_INS_STRD, arm.ARM_INS_LDR, arm.ARM_INS_LDRD):
        last = operands[-1]
        # Before the access by the offset, or after it by a number of its own.
        return -last.mem.disp if last.type == arm.ARM_OP_MEM else -last.imm
    return None


def bytes_of(registers) -> int:
    return sum(8 if DISASSEMBLER.reg_name(r.reg).startswith("d") else 4 for r in registers)
