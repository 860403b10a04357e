//! The libraries say in words what would help; here the words get the options of this program.

use formats::{Choice, Fault};

/// The option that a choice of the readers is made by.
pub fn of(choice: Choice) -> &'static str {
    match choice {
        Choice::Series => "--series NUMBER|UID",
        Choice::Uneven => "--uneven resample",
        Choice::Volume => "--volume N",
    }
}

/// What of a volume the user chose, as its reader calls it, and the option for it.
const CHOSEN: [(&str, &str); 4] = [
    ("the region", "--region"),
    ("the stride", "--stride"),
    ("the stated spacing", "--spacing"),
    ("the number of the volume", "--volume"),
];

/// What is wrong with a file, with the option behind a choice that does not suit it.
pub fn fault(fault: &Fault) -> String {
    if let Some(choice) = fault.choice() {
        return format!("{fault} ({})", of(choice));
    }
    let chosen = match fault {
        Fault::Value { what, .. } => CHOSEN.iter().find(|c| c.0 == *what),
        _ => None,
    };
    match chosen {
        Some((_, option)) => format!("{option}: {fault}"),
        None => fault.to_string(),
    }
}

/// What the fitting library advises, and the option for it.
const ADVICE: [(&str, &str); 12] = [
    ("find the directions from the positions alone", "--unoriented"),
    ("fit them by the robust loss", "--robust"),
    ("fit it as a cloud", "--as cloud"),
    ("a mesh can be trimmed there", "isoclay mesh --trim"),
    (
        "raise the memory ceiling or lower the depth limit",
        "--memory, --max-depth",
    ),
    ("the coefficients allowed are spent", "--coefficients"),
    ("the memory allowed is spent", "--memory"),
    (
        "a tolerance or a number of coefficients allows more",
        "--tolerance, --coefficients",
    ),
    (
        "raise the coefficients and the depth allowed",
        "--coefficients, --max-depth",
    ),
    ("triangles are made for that", "finer: --tolerance, --triangles"),
    ("raise the tolerance", "--tolerance"),
    ("allow more triangles", "--triangles"),
];

/// `text` with the option behind each piece of advice.
pub fn named(text: &str) -> String {
    let mut text = text.to_owned();
    for (words, option) in ADVICE {
        if let Some(at) = text.find(words) {
            text.insert_str(at + words.len(), &format!(" ({option})"));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_names_its_option() {
        let limit = fitting::FitError::MemoryLimit { needed: 2, limit: 1 }.to_string();
        assert!(named(&limit).ends_with("(--memory, --max-depth)"), "{limit}");
        assert_eq!(
            named("these are outliers, fit them by the robust loss, or not"),
            "these are outliers, fit them by the robust loss (--robust), or not"
        );
        assert_eq!(named("nothing to advise"), "nothing to advise");
    }
}
