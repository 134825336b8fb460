"""Calls whose target is only known at run time, and what they can lead to.

Each line is the caller, and the callee, as patterns of names. A caller without a line, and a function whose address is
stored somewhere though no line leads to it, are found and refused: whoever adds one adds a line, after checking.
"""

import re

WAKER = r"^embassy_executor::raw::waker::(clone|wake|drop)$"
TASK = r"::TaskStorage::poll$"
EXITED = r"^embassy_executor::raw::poll_exited$"

LEADS_TO = [
    # An executor runs what has been woken; the throttle task's is an interrupt.
    (r"^embassy_executor::.*Executor::(run|poll)$|^(USART3|CAN2_SCE)$", rf"{TASK}|{EXITED}"),
    # A waker's table: of the time queue, and of channels and pipes that a task waits for.
    (
        rf"^(_embassy_time_schedule_wake|embassy_time_queue_utils::|embassy_sync::waitqueue::)|{TASK}"
        r"|^siskin_firmware::tasks::kiss::send$"
        r"|^<embassy_sync::blocking_mutex::raw::\w+ as embassy_sync::blocking_mutex::raw::RawMutex>::lock$",
        WAKER,
    ),
    # MAVLink asks the throttle side and checks a changed parameter through what it is given.
    (r"^siskin_control::mavlink::(component|context|command)::", r" as siskin_throttle::access::Access>::"),
    (r"^siskin_control::mavlink::parameter::change$", r"^siskin_control::esc::Esc::with_component::{closure}$"),
    # What it hands bytes to is known at link time: the serial line's pipe, which wakes its task.
    (r"^siskin_control::mavlink::sender::Sender::send_payload$", WAKER),
]

NEVER_CALLED = [
    # They are in tables next to those above; nothing here owns a value of unknown type, whose drop or only call these
    # would be.
    r"^core::ptr::drop_in_place$",
    r"core::ops::function::FnOnce>?::call_once{vtable.shim}$",
]


def may_lead_to(caller: str, target: str) -> bool:
    """Returns whether an indirect call in one function can reach the other."""
    return any(re.search(a, caller) and re.search(b, target) for a, b in LEADS_TO)


def is_foreseen(target: str) -> bool:
    """Returns whether it is known who calls a function by its address."""
    patterns = [pattern for _, pattern in LEADS_TO] + NEVER_CALLED
    return any(re.search(pattern, target) for pattern in patterns)


def may_call(caller: str) -> bool:
    """Returns whether it is known whom a function calls by an address."""
    return any(re.search(pattern, caller) for pattern, _ in LEADS_TO)
