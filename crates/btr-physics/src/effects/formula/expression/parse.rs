//! Parser of expressions.

use super::op::{BuiltinFunction, ONES, One, Op, TWOS, Two, function, number, power};
use crate::effects::formula::error::FormulaError;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Maximum nesting of parentheses and exponents.
const MAX_NESTING: usize = 64;

/// Parses an expression in these names into operations.
pub(super) fn parsed(text: &str, names: &[&str]) -> Result<Vec<Op>, FormulaError> {
    let tokens = tokens(text)?;
    if tokens.is_empty() {
        return syntax("it is empty");
    }
    let mut parser = Parser { tokens: &tokens, names, ops: Vec::new(), nested: 0 };
    parser.sum()?;
    match parser.tokens.first() {
        None => Ok(parser.ops),
        Some(Token::Symbol(")")) => syntax("a `)` has no `(`"),
        Some(Token::Symbol(",")) => syntax("a `,` is outside of a function's parentheses"),
        Some(other) => syntax(format!("an operator is missing before `{}`", other.text())),
    }
}

pub(super) fn syntax<T>(what: impl Into<String>) -> Result<T, FormulaError> {
    Err(FormulaError::Syntax(what.into()))
}

pub(super) fn too_deep<T>() -> Result<T, FormulaError> {
    syntax("it is nested too deeply")
}

enum Token<'a> {
    Number(&'a str, f64),
    Name(&'a str),
    Symbol(&'a str),
}

impl<'a> Token<'a> {
    fn text(&self) -> &'a str {
        match self {
            Token::Number(text, _) | Token::Name(text) | Token::Symbol(text) => text,
        }
    }
}

fn tokens(text: &str) -> Result<Vec<Token<'_>>, FormulaError> {
    let (mut tokens, mut rest) = (Vec::new(), text.trim_start());
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '0'..='9' | '.' => digits(rest),
            '*' if rest.starts_with("**") => 2,
            '+' | '-' | '*' | '/' | '^' | '(' | ')' | ',' => 1,
            _ if first.is_alphabetic() || first == '_' => {
                rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
            }
            _ => return syntax(format!("`{first}` is not allowed in a law")),
        };
        let (token, after) = rest.split_at(length);
        tokens.push(match first {
            '0'..='9' | '.' => match token.parse() {
                Ok(number) => Token::Number(token, number),
                Err(_) => return syntax(format!("`{token}` is not a number")),
            },
            _ if first.is_alphabetic() || first == '_' => Token::Name(token),
            _ => Token::Symbol(token),
        });
        rest = after.trim_start();
    }
    Ok(tokens)
}

/// Length of a number: digits with points, and an exponent.
fn digits(text: &str) -> usize {
    let end =
        |from: usize| text[from..].find(|c: char| !c.is_ascii_digit() && c != '.').map_or(text.len(), |k| from + k);
    let mantissa = end(0);
    let exponent =
        text[mantissa..].strip_prefix(['e', 'E']).map(|exponent| exponent.strip_prefix(['+', '-']).unwrap_or(exponent));
    match exponent.filter(|exponent| exponent.starts_with(|c: char| c.is_ascii_digit())) {
        Some(exponent) => end(text.len() - exponent.len()),
        None => mantissa,
    }
}

/// The remaining tokens, and the operations so far.
struct Parser<'a> {
    tokens: &'a [Token<'a>],
    names: &'a [&'a str],
    ops: Vec<Op>,
    nested: usize,
}

impl<'a> Parser<'a> {
    /// Consumes the next token if it is one of these symbols.
    fn takes(&mut self, symbols: &[&str]) -> Option<&'a str> {
        let (Token::Symbol(next), rest) = self.tokens.split_first()? else { return None };
        symbols.contains(next).then(|| self.tokens = rest)?;
        Some(next)
    }

    fn one(&mut self, of: One) {
        match self.ops.last_mut() {
            Some(Op::Number(x)) => *x = of(*x),
            _ => self.ops.push(Op::One(of)),
        }
    }

    fn two(&mut self, of: Two) {
        if let [.., Op::Number(a), Op::Number(b)] = self.ops[..] {
            self.ops.truncate(self.ops.len() - 2);
            self.ops.push(Op::Number(of(a, b)));
        } else {
            self.ops.push(Op::Two(of));
        }
    }

    fn sum(&mut self) -> Result<(), FormulaError> {
        self.chain(Self::product, [("+", f64::add), ("-", f64::sub)])
    }

    fn product(&mut self) -> Result<(), FormulaError> {
        self.chain(Self::signed, [("*", f64::mul), ("/", f64::div)])
    }

    /// A chain of operators of the same precedence, from left to right.
    fn chain(
        &mut self,
        part: fn(&mut Self) -> Result<(), FormulaError>,
        operators: [(&str, Two); 2],
    ) -> Result<(), FormulaError> {
        part(self)?;
        while let Some(symbol) = self.takes(&operators.map(|(symbol, _)| symbol)) {
            part(self)?;
            operators.iter().filter(|(known, _)| *known == symbol).for_each(|(_, of)| self.two(*of));
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), FormulaError> {
        let mut negative = false;
        while let Some(sign) = self.takes(&["+", "-"]) {
            negative ^= sign == "-";
        }
        self.raised()?;
        if negative {
            self.one(f64::neg);
        }
        Ok(())
    }

    fn raised(&mut self) -> Result<(), FormulaError> {
        self.value()?;
        if self.takes(&["^", "**"]).is_some() {
            self.deeper(Self::signed)?;
            self.two(power);
        }
        Ok(())
    }

    fn deeper(&mut self, read: fn(&mut Self) -> Result<(), FormulaError>) -> Result<(), FormulaError> {
        if self.nested >= MAX_NESTING {
            return too_deep();
        }
        self.nested += 1;
        read(self)?;
        self.nested -= 1;
        Ok(())
    }

    fn value(&mut self) -> Result<(), FormulaError> {
        let Some((next, rest)) = self.tokens.split_first() else { return syntax("a value is missing at its end") };
        match *next {
            Token::Number(_, number) => self.ops.push(Op::Number(number)),
            Token::Name(name) => {
                self.tokens = rest;
                return self.named(name);
            }
            Token::Symbol("(") => {
                self.tokens = rest;
                self.deeper(Self::sum)?;
                return self.closed();
            }
            Token::Symbol(symbol) => return syntax(format!("a value is missing before `{symbol}`")),
        }
        self.tokens = rest;
        Ok(())
    }

    fn closed(&mut self) -> Result<(), FormulaError> {
        match (self.takes(&[")"]), self.tokens.first()) {
            (Some(_), _) => Ok(()),
            (None, None) => syntax("a `(` is not closed"),
            (None, Some(Token::Symbol(","))) => syntax("a `,` is superfluous"),
            (None, Some(other)) => syntax(format!("an operator is missing before `{}`", other.text())),
        }
    }

    /// A name, or a function with its arguments.
    fn named(&mut self, name: &str) -> Result<(), FormulaError> {
        let calls = self.takes(&["("]).is_some();
        match (function(name), calls) {
            (Some(BuiltinFunction::One(one)), true) => {
                self.deeper(Self::sum)?;
                self.one(one);
                self.closed()
            }
            (Some(BuiltinFunction::Two(two)), true) => {
                self.deeper(Self::sum)?;
                if self.takes(&[","]).is_none() {
                    return syntax(format!("{name} takes two values: {name}(x, y)"));
                }
                self.deeper(Self::sum)?;
                self.two(two);
                self.closed()
            }
            (Some(BuiltinFunction::One(_)), false) => syntax(format!("{name} takes a value: {name}(x)")),
            (Some(BuiltinFunction::Two(_)), false) => syntax(format!("{name} takes two values: {name}(x, y)")),
            (None, true) => {
                let known: Vec<&str> = ONES.iter().map(|(name, _)| *name).chain(TWOS.map(|(name, _)| name)).collect();
                syntax(format!("`{name}` is not a function; known functions: {}", known.join(" ")))
            }
            (None, false) => {
                self.ops.push(match self.names.iter().position(|known| *known == name) {
                    Some(place) => Op::Name(place),
                    None => Op::Number(number(name).ok_or_else(|| FormulaError::Unknown {
                        name: name.to_owned(),
                        known: self.names.iter().map(|&known| known.to_owned()).collect(),
                    })?),
                });
                Ok(())
            }
        }
    }
}
