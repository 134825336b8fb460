//! Table II: the operations of a control period.
//!
//! The paper counts the right-hand sides of its equations. Here they are counted in the functions that run, by reading
//! them: each sum or difference, product and comparison on the path of an unlimited period of Run, with Euler's sums,
//! whose products with T_s are within the gains. Shifts, negations and the saturation of sums are not counted, nor what
//! is inside a root, a sine or a cosine. The adaptation's inductance factor in ω·L·i is.

use crate::reproduce::item::{Item, item};

/// Sums, products, comparisons, roots with sines and cosines, and states of a block.
type Counts = [u32; 5];

/// A row of Table II.
struct Row {
    name: &'static str,
    /// As printed, for blocks on their own; the first row has "2 or 3" sums.
    printed: Counts,
    counted: Counts,
    /// Where it was counted.
    functions: &'static str,
}

const ROWS: [Row; 8] = [
    Row {
        name: "adaptive_observer",
        printed: [2, 6, 2, 1, 2],
        // |ĥ| one root; ξ̂·|ĥ|, k_η·ĥ_d, γ·ĥ_d; ω̂, ξ̂, θ̂; the bounds of ω̂ and ξ̂, and whether they hold.
        counted: [3, 3, 4, 1, 2],
        functions: "back_emf::estimate, adapt, θ̂ of advance; the angle's type wraps",
    },
    Row {
        name: "speed_filter",
        printed: [1, 1, 0, 0, 1],
        counted: [2, 1, 0, 0, 1],
        functions: "ω̂_f of back_emf::estimate (28)",
    },
    Row {
        name: "speed_controller",
        printed: [4, 4, 0, 0, 1],
        // ω*, its error, two of T*, σ_ω, two of the step of T*; trust, k_p, J, k_i, k_p; the share of the
        // error, two bounds, whether they hold, what is missing.
        counted: [7, 5, 6, 0, 1],
        functions: "nested::Config::current (8)",
    },
    Row {
        name: "current_reference",
        printed: [1, 5, 0, 0, 0],
        counted: [1, 3, 0, 0, 0],
        functions: "nested::Config::current (9)",
    },
    Row {
        name: "clarke_park",
        printed: [5, 7, 0, 2, 0],
        counted: [5, 5, 0, 2, 0],
        functions: "transform::clarke_in, park, sin_cos (12)",
    },
    Row {
        name: "current_controller",
        printed: [9, 9, 0, 0, 2],
        // Two errors, three and five of the voltages, σ in both, one sum per axis to integrate; ω·i and its factor per
        // axis, three and four gains, k_ie per axis.
        counted: [14, 13, 0, 0, 2],
        functions: "observer_based::Config::voltage, integrate (10)",
    },
    Row {
        name: "high_gain_observer",
        printed: [10, 10, 0, 0, 4],
        // Two errors, five sums per axis and one for ĥ; ω·i, its factor, four gains and k_i per axis.
        counted: [14, 14, 0, 0, 4],
        functions: "back_emf::advance (6)",
    },
    Row {
        name: "inverse_park_clarke",
        printed: [4, 4, 0, 2, 0],
        // Four of the rotation by the angle ahead, whose sine is taken now and then; four of that into the stator's
        // frame, with the sine from clarke_park; and √3/2.
        counted: [6, 9, 0, 0, 0],
        functions: "transform::rotate, inverse_park, phases_in (11)",
    },
];

const COLUMNS: [&str; 5] = [
    "sums",
    "multiplications",
    "comparisons",
    "roots_and_sincos",
    "states",
];

/// Table II.
pub(super) fn items() -> Vec<Item> {
    let rows = ROWS.iter().flat_map(|row| {
        let columns = COLUMNS.into_iter().zip(row.printed).zip(row.counted);
        columns.map(|((column, printed), counted)| {
            item(
                format!("table2_{}_{column}", row.name),
                Some(f64::from(printed)),
                f64::from(counted),
                "",
                format!("counted by reading {}", row.functions),
            )
        })
    });
    rows.collect()
}

/// Counts the operators in the functions' text, so that none of them changes without its row.
#[cfg(test)]
mod tests {
    use super::*;

    const BACK_EMF: &str = include_str!("../../../../shared/src/control/observer/back_emf.rs");
    const NESTED: &str = include_str!("../../../../shared/src/control/speed/nested.rs");
    const TRANSFORM: &str = include_str!("../../../../shared/src/control/transform.rs");
    const REGULATOR: &str =
        include_str!("../../../../shared/src/control/regulator/observer_based.rs");

    /// How sums, products and comparisons are written, each with how many it stands for.
    const SUMS: &[(&str, i32)] = &[
        (".plus(", 1),
        (".minus(", 1),
        (".wrapping_add(", 1),
        (".plus_top(", 1),
        (".minus_top(", 1),
        (" + ", 1),
        (" - ", 1),
        // Doubling is a shift, not a sum.
        ("x.plus(x)", -1),
    ];
    const PRODUCTS: &[(&str, i32)] = &[
        (".top(", 1),
        (".apply(", 1),
        (".held(", 1),
        // The inductance's factor.
        (".of(", 1),
        (".plus_top(", 1),
        (".minus_top(", 1),
        (" * ", 1),
        // Doubling is a shift, not a product.
        ("2 * ", -1),
    ];
    const COMPARISONS: &[(&str, i32)] = &[
        (".max(", 1),
        (".min(", 1),
        (" != ", 1),
        (" < ", 1),
        // Between two bounds.
        (".hold(", 2),
    ];

    /// Returns the text from an opening bracket to the closing one, without them.
    fn within(text: &str, [open, close]: [char; 2]) -> &str {
        let begin = text.find(open).expect("an opening bracket") + 1;
        let mut depth = 1;
        let end = text[begin..].find(|c| {
            depth += i32::from(c == open) - i32::from(c == close);
            depth == 0
        });
        &text[begin..begin + end.expect("a closing bracket")]
    }

    /// Returns the statements of a function, without its comments and the blocks after these words.
    fn statements(source: &str, name: &str, left_out: &[&str]) -> Vec<String> {
        let lines = source.lines().map(|line| {
            let code = line.split("//").next();
            code.unwrap_or_default()
        });
        let code = lines.collect::<Vec<_>>().join("\n");
        let head = format!("fn {name}");
        let begins = code
            .match_indices(&head)
            .map(|(at, _)| &code[at + head.len()..]);
        let [from] = begins
            .filter(|rest| rest.starts_with(['(', '<']))
            .collect::<Vec<_>>()[..]
        else {
            panic!("no function {name}, or several");
        };
        let parameters = within(from, ['(', ')']);
        let after = &from[from.find(parameters).expect("within it") + parameters.len()..];
        let mut body = within(after, ['{', '}']).to_owned();
        for words in left_out {
            let at = body.find(words).expect(words);
            let block = within(&body[at..], ['{', '}']).to_owned();
            body = body.replacen(&block, "", 1);
        }
        let mut depth = 0;
        let split = body.split_inclusive(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            depth == 0 && matches!(c, ';' | '}')
        });
        // A closure counts as often as it is called.
        let counted = split.flat_map(|statement| {
            let statement = statement.trim();
            let closure = statement.strip_prefix("let ");
            let closure = closure.and_then(|rest| rest.split_once(" = |"));
            let times = closure.map_or(1, |(name, _)| body.matches(&format!("{name}(")).count());
            std::iter::repeat_n(statement.to_owned(), times)
        });
        counted.collect()
    }

    /// Splits statements into those that begin with one of these, and the others.
    fn parted(statements: Vec<String>, begins: &[&str]) -> [Vec<String>; 2] {
        for begin in begins {
            assert!(
                statements.iter().any(|s| s.starts_with(begin)),
                "no {begin}"
            );
        }
        let (those, others) = statements
            .into_iter()
            .partition(|statement| begins.iter().any(|begin| statement.starts_with(begin)));
        [those, others]
    }

    fn count(statements: &[String]) -> [i32; 3] {
        [SUMS, PRODUCTS, COMPARISONS].map(|ways| {
            let counts = ways.iter().map(|(way, each)| {
                let found = statements.iter().map(|text| text.matches(way).count());
                each * found.sum::<usize>() as i32
            });
            counts.sum()
        })
    }

    #[test]
    fn the_functions_have_the_operators_that_were_counted() {
        let all = |source, name| statements(source, name, &[]);
        let estimate = all(BACK_EMF, "estimate");
        let [filter, adaptive] = parted(estimate, &["let omega_bar_step =", "state.omega_f ="]);
        let [theta, high_gain] = parted(all(BACK_EMF, "advance"), &["state.theta ="]);
        // The path of a period with nothing limited.
        let current = statements(NESTED, "current", &["if half_trust <", "if bounded !="]);
        let [reference, speed] = parted(current, &["let i_q =", "Reference {"]);
        let counted = [
            [adaptive, all(BACK_EMF, "adapt"), theta].concat(),
            filter,
            speed,
            reference,
            [all(TRANSFORM, "clarke_in"), all(TRANSFORM, "park")].concat(),
            ["voltage", "without_integrators", "error", "integrate"]
                .map(|name| all(REGULATOR, name))
                .concat(),
            high_gain,
            // `turn` is one, too.
            ["inverse_park", "inverse_park", "phases_in"]
                .map(|name| all(TRANSFORM, name))
                .concat(),
        ];
        for (row, statements) in ROWS.iter().zip(counted) {
            let [sums, products, comparisons, ..] = row.counted;
            let wanted = [sums, products, comparisons].map(|count| count as i32);
            assert_eq!(count(&statements), wanted, "{}: {statements:#?}", row.name);
        }
    }
}
