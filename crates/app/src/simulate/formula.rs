//! Formulas of position and density, such as `1 + 4*max(0, z)`.

use exmex::{BinOp, Express, FlatEx, MakeOperators, Operator};
use glam::DVec3;

/// What may stand in a formula: world coordinates and the density of the field.
const NAMES: [&str; 4] = ["d", "x", "y", "z"];
/// Longest formula.
const LONGEST: usize = 1000;

/// The functions: those of `libm`, which gives the same bits on every machine. There is no `^`, because a sign binds
/// tighter than any operator here, which nobody expects of `-x^2`; `pow` cannot be misread.
#[derive(Clone, Debug)]
struct Functions;

impl MakeOperators<f64> for Functions {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        let binary = |name, prio, apply| {
            Operator::make_bin(
                name,
                BinOp {
                    apply,
                    prio,
                    is_commutative: false,
                },
            )
        };
        let signed = |name, apply, unary| {
            Operator::make_bin_unary(
                name,
                BinOp {
                    apply,
                    prio: 1,
                    is_commutative: false,
                },
                unary,
            )
        };
        vec![
            signed("+", |a, b| a + b, |a| a),
            signed("-", |a, b| a - b, |a| -a),
            binary("*", 2, |a, b| a * b),
            binary("/", 3, |a, b| a / b),
            binary("<", 0, |a, b| f64::from(a < b)),
            binary(">", 0, |a, b| f64::from(a > b)),
            binary("min", 4, f64::min),
            binary("max", 4, f64::max),
            binary("pow", 4, libm::pow),
            Operator::make_unary("abs", f64::abs),
            Operator::make_unary("sqrt", f64::sqrt),
            Operator::make_unary("exp", libm::exp),
            Operator::make_unary("ln", libm::log),
            Operator::make_unary("sin", libm::sin),
            Operator::make_unary("cos", libm::cos),
            Operator::make_constant("PI", std::f64::consts::PI),
        ]
    }
}

/// A formula of `x`, `y`, `z` and `d`.
#[derive(Clone, Debug)]
pub struct Formula {
    expression: FlatEx<f64, Functions>,
    /// Places in [`NAMES`] of its variables, in the order it takes them.
    variables: Vec<usize>,
}

impl Formula {
    /// Reads a formula.
    ///
    /// # Errors
    /// What is wrong with it, and what may stand in one.
    pub fn parse(text: &str) -> Result<Self, String> {
        let wrong = |why: String| {
            format!(
                "the formula {text:?} cannot be read: {why}; it may hold numbers, x, y, z, d (density), PI, + - * / < > \
                 ( ), min(a, b), max(a, b), pow(a, b), abs, sqrt, exp, ln, sin, cos"
            )
        };
        if text.len() > LONGEST {
            return Err(format!("a formula of {} bytes; at most {LONGEST} are read", text.len()));
        }
        let expression = FlatEx::<f64, Functions>::parse(text).map_err(|e| wrong(e.to_string()))?;
        let place = |name: &String| {
            let known = NAMES.iter().position(|n| n == name);
            known.ok_or_else(|| wrong(format!("nothing is called {name}")))
        };
        let variables = expression.var_names().iter().map(place).collect::<Result<_, _>>()?;
        Ok(Self {
            expression,
            variables,
        })
    }

    /// Its value where the field has the density `d`.
    ///
    /// # Errors
    /// If the value is not finite, with the place.
    pub fn at(&self, p: DVec3, d: f64) -> Result<f64, String> {
        let all = [d, p.x, p.y, p.z];
        let values: Vec<f64> = self.variables.iter().map(|v| all[*v]).collect();
        let value = self.expression.eval(&values).map_err(|e| e.to_string())?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(format!(
                "the formula {} is {value} at x = {}, y = {}, z = {}, d = {d}; it has to be finite in the whole region",
                self.expression, p.x, p.y, p.z
            ))
        }
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
            ("1.5e-1 * 2", 0.3),
            ("x + y*z - d", 10.0),
            ("20 - x - y", 15.0),
            ("20 - x + y", 21.0),
            ("12 / x * y", 18.0),
            ("60 / x / y", 10.0),
            ("12 * x / y", 8.0),
            ("-pow(x, 2)", -4.0),
            ("2 * -x", -4.0),
            ("min(x, y) + max(x, y)", 5.0),
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
            "", " ", "(", ")", "x y", "x +", "sin", "1..2", "1,5", "x^2", "w", "{x}", "min(x)", "min(x, y, z)", "x()",
            "\u{e9}", "\0", "1e", "--", "import os", "((((x)", "d d", "x;y",
        ] {
            let e = Formula::parse(text).expect_err(text);
            assert!(e.contains("pow(a, b)"), "{text:?}: {e}");
        }
        assert!(Formula::parse(&"-".repeat(2000)).is_err());
    }

    #[test]
    fn values_that_are_not_finite_are_refused_with_the_place() {
        let f = Formula::parse("1 / (x - 2)").unwrap();
        let e = f.at(DVec3::new(2.0, 0.0, 0.0), 0.0).unwrap_err();
        assert!(e.contains("x = 2") && e.contains("inf"), "{e}");
    }
}
