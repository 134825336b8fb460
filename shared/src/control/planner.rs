//! The trajectory planner: from a speed command Ω* to ω* and its derivative.

use crate::units::Speed;

/// Moves the reference towards the command by at most `slew` a period.
///
/// Returns the new reference ω* and its step ω̇*·T_s.
#[inline(always)]
pub fn plan(reference: Speed, command: Speed, slew: Speed) -> (Speed, Speed) {
    let step = command.saturating_sub(reference).min(slew).max(-slew);
    (reference.saturating_add(step), step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slew_is_kept_both_ways_and_the_command_is_reached() {
        let slew = Speed::from_num(0.001);
        let command = Speed::from_num(0.0105);
        let mut reference = Speed::ZERO;
        for period in 0..11 {
            let (next, step) = plan(reference, command, slew);
            assert_eq!(step, next - reference);
            assert_eq!(step == slew, period < 10);
            reference = next;
        }
        assert_eq!(reference, command);
        assert_eq!(plan(reference, Speed::ZERO, slew).1, -slew);
    }
}
