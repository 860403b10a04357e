//! Formulas of position and density, such as `1 + 4*max(0, z)`.
//!
//! Of the crates that read formulas none is maintained, freely licensed and right about `min(1, max(0, x))` and `2e-3` at
//! once. Elementary functions are those of `libm`, which gives the same bits on every machine.

use glam::DVec3;

use super::operations::{Binary, Number, Unary};

/// Longest formula, in bytes, and deepest nesting.
const LONGEST: usize = 1000;
const DEEPEST: usize = 50;

/// A formula of the world coordinates `x`, `y`, `z` and the density `d`.
#[derive(Clone, Debug)]
pub struct Formula {
    text: String,
    root: Node,
}

#[derive(Clone, Debug)]
enum Node {
    Number(f64),
    /// Place in `[x, y, z, d]`.
    Variable(usize),
    Unary(Unary, Box<Node>),
    Binary(Binary, Box<[Node; 2]>),
}

enum Function {
    One(Unary),
    Two(Binary),
}

fn function(name: &str) -> Option<Function> {
    Some(match name {
        "min" => Function::Two(Binary::Min),
        "max" => Function::Two(Binary::Max),
        "abs" => Function::One(Unary::Abs),
        "sqrt" => Function::One(Unary::Sqrt),
        "exp" => Function::One(Unary::Exp),
        "ln" => Function::One(Unary::Ln),
        "sin" => Function::One(Unary::Sin),
        "cos" => Function::One(Unary::Cos),
        _ => return None,
    })
}

impl Formula {
    /// Reads a formula.
    ///
    /// # Errors
    /// What is wrong with it, and what may stand in one.
    pub fn parse(text: &str) -> Result<Self, String> {
        Self::parse_of(&["x", "y", "z", "d"], "x, y, z, d (density)", text)
    }

    /// Reads a formula of one number `t`; [`at_parameter`](Self::at_parameter) tells its values.
    ///
    /// # Errors
    /// What is wrong with it, and what may stand in one.
    pub fn parse_parameter(text: &str) -> Result<Self, String> {
        Self::parse_of(&["t"], "t", text)
    }

    fn parse_of(names: &'static [&'static str], told: &str, text: &str) -> Result<Self, String> {
        let wrong = |why: String, rest: &str| {
            let at = text[..text.len() - rest.len()].chars().count() + 1;
            format!(
                "the formula {text:?} cannot be read at character {at}: {why}; it may hold numbers, {told}, PI, + - * / ^ < > \
                 ( ), min(a, b), max(a, b), abs, sqrt, exp, ln, sin, cos"
            )
        };
        if text.len() > LONGEST {
            return Err(format!(
                "the formula has {} bytes; at most {LONGEST} are possible",
                text.len()
            ));
        }
        let mut parser = Parser {
            rest: text.trim_start(),
            names,
        };
        let root = parser.comparison(0).map_err(|why| wrong(why, parser.rest))?;
        if !parser.rest.is_empty() {
            return Err(wrong(
                format!("it should end before {:?}", parser.rest),
                parser.rest,
            ));
        }
        Ok(Self {
            text: text.into(),
            root,
        })
    }

    /// Its value for numbers of any kind in place of `x`, `y` and `z`; the density counts as 0.
    pub(crate) fn of<N: Number>(&self, [x, y, z]: [N; 3]) -> N {
        self.root.value(&[x, y, z, N::of(0.0)])
    }

    /// Whether the density is in it.
    pub fn reads_density(&self) -> bool {
        self.root.reads(3)
    }

    /// The value at `t` of one that was read as a formula of `t`.
    ///
    /// # Errors
    /// If the value is not finite.
    pub fn at_parameter(&self, t: f64) -> Result<f64, String> {
        let value = self.root.value(&[t, 0.0, 0.0, 0.0]);
        match value.is_finite() {
            true => Ok(value),
            false => Err(format!(
                "the formula {:?} is {value} at t = {t}; it has to be finite from end to end",
                self.text
            )),
        }
    }

    /// Its value where the field has the density `d`.
    ///
    /// # Errors
    /// If the value is not finite, with the place.
    pub fn at(&self, p: DVec3, d: f64) -> Result<f64, String> {
        let value = self.root.value(&[p.x, p.y, p.z, d]);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(format!(
                "the formula {:?} is {value} at x = {}, y = {}, z = {}, d = {d}; it has to be finite in the whole region",
                self.text, p.x, p.y, p.z
            ))
        }
    }
}

impl Node {
    fn value<N: Number>(&self, of: &[N; 4]) -> N {
        match self {
            Self::Number(v) => N::of(*v),
            Self::Variable(i) => of[*i],
            Self::Unary(f, a) => N::unary(*f, a.value(of)),
            Self::Binary(f, ab) => N::binary(*f, ab[0].value(of), ab[1].value(of)),
        }
    }

    fn binary(f: Binary, a: Self, b: Self) -> Self {
        Self::Binary(f, Box::new([a, b]))
    }

    fn reads(&self, variable: usize) -> bool {
        match self {
            Self::Number(_) => false,
            Self::Variable(i) => *i == variable,
            Self::Unary(_, a) => a.reads(variable),
            Self::Binary(_, ab) => ab.iter().any(|n| n.reads(variable)),
        }
    }
}

/// Recursive descent: a function for each rank of operators, the loosest first.
struct Parser<'a> {
    /// What is not read yet, without blanks in front.
    rest: &'a str,
    /// Its variables.
    names: &'static [&'static str],
}

impl Parser<'_> {
    fn take(&mut self, token: char) -> bool {
        let taken = self.rest.strip_prefix(token);
        if let Some(rest) = taken {
            self.rest = rest.trim_start();
        }
        taken.is_some()
    }

    fn expect(&mut self, token: char) -> Result<(), String> {
        if self.take(token) {
            Ok(())
        } else {
            Err(format!("{token} is missing before {:?}", self.rest))
        }
    }

    /// 1 where it holds, 0 elsewhere.
    fn comparison(&mut self, depth: usize) -> Result<Node, String> {
        if depth > DEEPEST {
            return Err(format!("it is nested more than {DEEPEST} deep"));
        }
        let left = self.sum(depth)?;
        if self.take('<') {
            return Ok(Node::binary(Binary::Less, left, self.sum(depth)?));
        }
        if self.take('>') {
            return Ok(Node::binary(Binary::Greater, left, self.sum(depth)?));
        }
        Ok(left)
    }

    fn sum(&mut self, depth: usize) -> Result<Node, String> {
        let mut left = self.product(depth)?;
        loop {
            let f = match () {
                () if self.take('+') => Binary::Add,
                () if self.take('-') => Binary::Subtract,
                () => return Ok(left),
            };
            left = Node::binary(f, left, self.product(depth)?);
        }
    }

    fn product(&mut self, depth: usize) -> Result<Node, String> {
        let mut left = self.signed(depth)?;
        loop {
            let f = match () {
                () if self.take('*') => Binary::Multiply,
                () if self.take('/') => Binary::Divide,
                () => return Ok(left),
            };
            left = Node::binary(f, left, self.signed(depth)?);
        }
    }

    /// Signs bind less than powers: `-x^2` is `-(x^2)`.
    fn signed(&mut self, depth: usize) -> Result<Node, String> {
        if depth > DEEPEST {
            return Err(format!("it is nested more than {DEEPEST} deep"));
        }
        if self.take('-') {
            return Ok(Node::Unary(Unary::Negate, Box::new(self.signed(depth + 1)?)));
        }
        let base = self.atom(depth)?;
        if self.take('^') {
            // From the right: 2^3^2 is 2^9.
            return Ok(Node::binary(Binary::Power, base, self.signed(depth + 1)?));
        }
        Ok(base)
    }

    fn atom(&mut self, depth: usize) -> Result<Node, String> {
        if self.take('(') {
            let inner = self.comparison(depth + 1)?;
            self.expect(')')?;
            return Ok(inner);
        }
        if self.rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return self.number();
        }
        let end = self
            .rest
            .find(|c: char| !c.is_ascii_alphanumeric())
            .unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        if name.is_empty() {
            return Err(match rest {
                "" => "it ends too early".into(),
                rest => format!("{rest:?} is neither a number nor a variable nor a function"),
            });
        }
        let before = std::mem::replace(&mut self.rest, rest.trim_start());
        if let Some(i) = self.names.iter().position(|n| *n == name) {
            return Ok(Node::Variable(i));
        }
        if name == "PI" {
            return Ok(Node::Number(std::f64::consts::PI));
        }
        let Some(function) = function(name) else {
            self.rest = before;
            return Err(format!("there is no variable or function called {name}"));
        };
        self.expect('(')?;
        let first = self.comparison(depth + 1)?;
        let node = match function {
            Function::One(f) => Node::Unary(f, Box::new(first)),
            Function::Two(f) => {
                self.expect(',')?;
                Node::binary(f, first, self.comparison(depth + 1)?)
            }
        };
        self.expect(')')?;
        Ok(node)
    }

    fn number(&mut self) -> Result<Node, String> {
        let digits = |from: usize| self.rest[from..].bytes().take_while(u8::is_ascii_digit).count();
        let mut end = digits(0);
        if self.rest[end..].starts_with('.') {
            end += 1 + digits(end + 1);
        }
        if self.rest[end..].starts_with(['e', 'E']) {
            let sign = usize::from(self.rest[end + 1..].starts_with(['+', '-']));
            let exponent = digits(end + 1 + sign);
            end += if exponent > 0 { 1 + sign + exponent } else { 0 };
        }
        let (number, rest) = self.rest.split_at(end);
        let value = number.parse().map_err(|_| format!("{number} is not a number"))?;
        self.rest = rest.trim_start();
        Ok(Node::Number(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        let f = Formula::parse(text).unwrap_or_else(|e| panic!("{e}"));
        f.at(DVec3::new(2.0, 3.0, 5.0), 7.0).unwrap()
    }

    #[test]
    fn formulas_follow_the_rules_of_arithmetic() {
        for (text, expected) in [
            ("1", 1.0),
            (" 1.5e-1*2 + .5e+1 + 2E0 - 2. ", 5.3),
            ("x + y*z - d", 10.0),
            ("20 - x - y", 15.0),
            ("20 - x + y", 21.0),
            ("60 / x / y", 10.0),
            ("12 / x * y", 18.0),
            ("-x^2", -4.0),
            ("2^-1 + 2^3^2 - x^2*y", 500.5),
            ("(-x)^2 - -x", 6.0),
            ("2 * -x", -4.0),
            ("min(x, y) + max(x, min(y, max(z, 1)))", 5.0),
            ("1 + 9 * (z > 4)", 10.0),
            ("x < y - 4", 0.0),
            ("sqrt(abs(-x * 8)) + exp(ln(z)) + sin(0) + cos(PI)", 8.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-14, "{text}: {}", value(text));
        }
    }

    #[test]
    fn what_is_no_formula_is_refused_with_what_is_one() {
        for text in [
            "",
            " ",
            "(",
            ")",
            "x y",
            "x +",
            "sin",
            "sin x",
            "1..2",
            "1,5",
            "w",
            "{x}",
            "min(x)",
            "min(x, y, z)",
            "x()",
            "\u{e9}",
            "\0",
            "1e",
            ".",
            "--",
            "import os",
            "((((x)",
            "d d",
            "x;y",
            "1 < 2 < 3",
            "2x",
            "+",
        ] {
            let e = Formula::parse(text).expect_err(text);
            assert!(e.contains("max(a, b)"), "{text:?}: {e}");
        }
        for (open, close) in [("(", ")"), ("-", ""), ("2^", ""), ("abs(", ")")] {
            let deep = format!("{}x{}", open.repeat(100), close.repeat(100));
            assert!(Formula::parse(&deep).unwrap_err().contains("nested"), "{deep}");
        }
        assert!(
            Formula::parse(&"1+".repeat(600))
                .unwrap_err()
                .contains("1200 bytes")
        );
    }

    #[test]
    fn values_that_are_not_finite_are_refused_with_the_place() {
        let f = Formula::parse("1 / (x - 2)").unwrap();
        let e = f.at(DVec3::new(2.0, 0.0, 0.0), 0.0).unwrap_err();
        assert!(e.contains("x = 2") && e.contains("inf"), "{e}");
    }
}
