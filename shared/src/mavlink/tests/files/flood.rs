//! More requests than a poll answers.

use super::*;

/// Each produces a whole file: what arrives between two polls must not delay the next.
#[test]
fn of_a_flood_of_requests_few_are_answered_at_a_poll() {
    let mut bench = Bench::new();
    for (request, answered) in [
        (path(CRC, "parameter.json.xz"), 1),
        (path(OPEN, PACK), 1),
        (path(LIST, ""), 1),
        (read(READ, 0, 80), 5),
    ] {
        // Every other poll is for others.
        for answered in [answered, 0, answered, 0] {
            for _ in 0..70 {
                send(&mut bench, request);
            }
            let answers = told(&bench.answers());
            assert_eq!(answers.len(), answered, "{}", request.code);
            assert!(answers.iter().all(|told| told.code == ACK));
        }
    }
}

#[test]
fn a_flood_of_one_does_not_keep_out_another() {
    let mut bench = Bench::new();
    let other = Address {
        system: STATION.system - 1,
        ..STATION
    };
    for flood in [path(CRC, "parameter.json.xz"), read(READ, 0, 80)] {
        let mut polls = 0;
        // Behind each poll's flood, as its answers come.
        let mut requests = [path(OPEN, PACK), read(READ, 0, 80), read(TERMINATE, 0, 0)].into_iter();
        let mut request = requests.next();
        while let Some(wanted) = request {
            for _ in 0..70 {
                send(&mut bench, flood);
            }
            send(
                &mut bench,
                Ask {
                    from: other,
                    ..wanted
                },
            );
            let answers = told(&bench.answers());
            polls += 1;
            assert!(polls < 10, "{} after {polls}", wanted.code);
            if answers.iter().any(|told| {
                told.request == wanted.code && told.to == [other.system, other.component]
            }) {
                request = requests.next();
            }
        }
    }
}
