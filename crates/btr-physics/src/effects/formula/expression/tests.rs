//! Expressions evaluate to the right value, and syntax errors are described.
#![allow(clippy::unwrap_used)]
use super::op::power;
use super::*;
use proptest::prelude::*;

fn value(text: &str) -> f64 {
    Expression::new(text, &["q", "dq"]).unwrap().at(|name| [0.5, -3.0][name])
}

fn refused(text: &str) -> String {
    Expression::new(text, &["q", "dq"]).err().unwrap().to_string()
}

#[test]
fn operators_bind_as_in_mathematics() {
    let known = [
        ("-2^2", -4.0),
        ("-dq^2", -9.0),
        ("2^3^2", 512.0),
        ("2**-1", 0.5),
        ("-2**-2", -0.25),
        ("6/2*3", 9.0),
        ("2-3+4", 3.0),
        ("2-(3+4)", -5.0),
        ("2*-3", -6.0),
        ("--+-2", -2.0),
        ("1e-3 + 2.E2 + .5", 200.501),
        ("max(0, -q)^2 - min(q, dq)", 3.0),
        ("sign(dq)*sqrt(4)", -2.0),
        ("sign(0)", 0.0),
        ("atan2(0, -1) - pi", 0.0),
        ("cos(PI)", -1.0),
    ];
    for (text, is) in known {
        assert!((value(text) - is).abs() < 1e-12, "{text} = {}", value(text));
    }
}

#[test]
fn syntax_errors_are_described() {
    let errors = [
        ("", "it is empty"),
        ("dq*", "a value is missing at its end"),
        ("*dq", "a value is missing before `*`"),
        ("q +* 2", "a value is missing before `*`"),
        ("max(,q)", "a value is missing before `,`"),
        ("2 dq", "an operator is missing before `dq`"),
        ("2(dq)", "an operator is missing before `(`"),
        ("sin(q dq)", "an operator is missing before `dq`"),
        ("(q", "a `(` is not closed"),
        ("q)", "a `)` has no `(`"),
        ("q, dq", "a `,` is outside of a function's parentheses"),
        ("max(q)", "max takes two values: max(x, y)"),
        ("max(q, dq, 1)", "a `,` is superfluous"),
        ("sin", "sin takes a value: sin(x)"),
        ("sin q", "sin takes a value: sin(x)"),
        ("sing(q)", "`sing` is not a function; known functions: abs sign sqrt"),
        ("1..2", "`1..2` is not a number"),
        ("q*1e400", "a constant part of it is not a finite number"),
        ("q + sqrt(-1)", "a constant part of it is not a finite number"),
        ("q $ 2", "`$` is not allowed in a law"),
        ("a*q", "the unknown name `a`; known names: q, dq"),
    ];
    for (text, why) in errors {
        assert!(refused(text).contains(why), "{text}: {}", refused(text));
    }
    assert!(refused(&"(".repeat(1000)).contains("nested too deeply"));
    assert!(refused(&"2^".repeat(1000)).contains("nested too deeply"));
    assert!(refused(&format!("{}q{}", "q+(".repeat(40), ")".repeat(40))).contains("nested too deeply"));
}

/// A random expression: its text, ...
#[derive(Clone, Debug)]
struct Written {
    text: String,
    /// ... its value, ...
    is: f64,
    /// ... the precedence of its outermost operator: 0 sums, 1 products, 2 signs, 3 powers, 4 values, ...
    binds: u8,
    /// ... whether it contains no name, ...
    constant: bool,
    /// ... and whether one of its constant parts is not finite.
    refused: bool,
}

impl Written {
    fn value(text: &str, is: f64, constant: bool) -> Self {
        Written { text: text.to_owned(), is, binds: 4, constant, refused: false }
    }

    /// In parentheses if its precedence is below `least`.
    fn within(&self, least: u8) -> String {
        if self.binds < least { format!("({})", self.text) } else { self.text.clone() }
    }

    /// Whether it is refused as a part of another expression: a constant is evaluated first and must be finite.
    fn spoils(&self) -> bool {
        self.refused || (self.constant && !self.is.is_finite())
    }
}

fn expressions() -> impl Strategy<Value = Written> {
    let leaf = prop_oneof![
        (0u32..50).prop_map(|k| f64::from(k) / 8.0).prop_map(|x| Written::value(&x.to_string(), x, true)),
        Just(Written::value("q", 0.5, false)),
        Just(Written::value("dq", -3.0, false)),
    ];
    leaf.prop_recursive(5, 40, 2, |inner| {
        (inner.clone(), inner, 0..8u8).prop_map(|(a, b, kind)| {
            let both = |x: u8, symbol: &str, y: u8| format!("{}{symbol}{}", a.within(x), b.within(y));
            let (text, is, binds) = match kind {
                0 => (both(0, " + ", 1), a.is + b.is, 0),
                1 => (both(0, "-", 1), a.is - b.is, 0),
                2 => (both(1, "*", 2), a.is * b.is, 1),
                3 => (both(1, " / ", 2), a.is / b.is, 1),
                4 => (format!("-{}", a.within(2)), -a.is, 2),
                5 => (both(4, "^", 2), power(a.is, b.is), 3),
                6 => (format!("abs({})", a.text), a.is.abs(), 4),
                _ => (format!("max({},{})", a.text, b.text), a.is.max(b.is), 4),
            };
            let alone = matches!(kind, 4 | 6);
            let constant = a.constant && (alone || b.constant);
            let refused = !constant && (a.spoils() || (!alone && b.spoils()));
            Written { text, is, binds, constant, refused }
        })
    })
}

proptest! {
    #[test]
    fn an_expression_evaluates_to_its_value(written in expressions()) {
        let (text, is) = (&written.text, written.is);
        if written.spoils() {
            prop_assert!(refused(text).contains("a constant part of it is not a finite number"), "{text}: {}", refused(text));
        } else {
            let evaluated = value(text);
            let same = evaluated.to_bits() == is.to_bits() || (evaluated.is_nan() && is.is_nan());
            prop_assert!(same, "{text}: {evaluated}, not {is}");
        }
    }
}
