//! The ESC's identity on MAVLink.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, MavType};
use siskin_params::choice::MavRole;
use siskin_params::{ParamId, Params};

use super::frame::{Address, Frame};
use super::place::Place;

/// The ESC's role for a ground station (`MAV_ROLE`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// A vehicle of its own, component 1: ground stations show nothing else.
    Standalone,
    /// A component beside an autopilot.
    Peripheral,
}

/// The ESC's address and role; its parameters apply at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Identity {
    pub(super) role: Role,
    pub(super) address: Address,
    pub(super) place: Place,
    autopilot_heard: bool,
}

impl Identity {
    pub(super) fn new(params: &Params) -> Self {
        let role = if params.chosen(MavRole::Standalone) {
            Role::Standalone
        } else {
            Role::Peripheral
        };
        let (component, place) = match role {
            Role::Standalone => (1, Place::FIRST),
            Role::Peripheral => {
                let component = params.get(ParamId::MavCompId) as u8;
                (component, Place::of_component(component))
            }
        };
        Self {
            role,
            address: Address {
                system: params.get(ParamId::MavSysId) as u8,
                component,
            },
            place,
            autopilot_heard: false,
        }
    }

    /// Returns the number of its motor, from 0, if its component id numbers it.
    #[cfg(feature = "group")]
    pub(super) fn number(&self) -> Option<u8> {
        Place::number_of_component(self.address.component)
    }

    /// Returns true if this target includes this ESC.
    pub(super) fn is_for(&self, target: Address) -> bool {
        (target.system == 0 || target.system == self.address.system)
            && (target.component == 0 || target.component == self.address.component)
    }

    /// Returns true for the first sign of an autopilot, which a peripheral waits for.
    pub(super) fn awaits(&self, frame: &Frame) -> bool {
        // Offset 5 is the autopilot, INVALID for ground stations and other peripherals. System 0 means all, and is no
        // sender.
        let from_autopilot = frame.id == HEARTBEAT_DATA::ID
            && frame.from.system != 0
            && frame.from.component == 1
            && frame.u8(5) != MavAutopilot::MAV_AUTOPILOT_INVALID as u8;
        self.role == Role::Peripheral && from_autopilot && !self.autopilot_heard
    }

    /// Joins the system of the first autopilot heard, whatever its id: a peripheral belongs to it.
    pub(super) fn belong_to(&mut self, autopilot: Address) {
        self.autopilot_heard = true;
        self.address.system = autopilot.system;
    }

    pub(super) fn kind(&self) -> (MavType, MavAutopilot) {
        match self.role {
            Role::Standalone => (
                MavType::MAV_TYPE_GENERIC,
                MavAutopilot::MAV_AUTOPILOT_GENERIC,
            ),
            Role::Peripheral => (MavType::MAV_TYPE_SERVO, MavAutopilot::MAV_AUTOPILOT_INVALID),
        }
    }
}
