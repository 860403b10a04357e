//! `--knots`: where the knots of a block lie.

/// Most knots that one range may stand for; how many a block may have is the block's own matter.
const MOST: usize = 1 << 16;

/// Knots on each axis as the user writes them: `x=-2,-1,0..1/10,3;z=0..5/20`. A number is a knot; `A..B/N` are knots from A to
/// B in N equal intervals, of which A may be the knot before. Axes that are not named have none.
#[derive(Clone, Debug)]
pub struct Knots {
    /// As it was written, for messages.
    pub text: String,
    lists: [Vec<f64>; 3],
}

impl std::str::FromStr for Knots {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut knots: [Vec<f64>; 3] = Default::default();
        for part in text.split(';').map(str::trim).filter(|part| !part.is_empty()) {
            let (name, list) = part
                .split_once('=')
                .ok_or_else(|| format!("{part:?} names no axis; write x=, y= or z= before its knots"))?;
            let axis = ["x", "y", "z"].iter().position(|axis| *axis == name.trim());
            let axis = axis.ok_or_else(|| format!("there is no axis {:?}; write x, y or z", name.trim()))?;
            if !knots[axis].is_empty() {
                return Err(format!(
                    "axis {name} is there twice; write all its knots in one list"
                ));
            }
            for item in list.split(',').map(str::trim) {
                put(&mut knots[axis], item).map_err(|why| format!("axis {}: {why}", name.trim()))?;
            }
        }
        match knots.iter().all(Vec::is_empty) {
            true => Err("there are no knots; write them as x=-1,-0.5,0..1/20;z=0..5/10".into()),
            false => Ok(Self {
                text: text.into(),
                lists: knots,
            }),
        }
    }
}

/// Puts a knot, or a range of them, behind others.
fn put(knots: &mut Vec<f64>, item: &str) -> Result<(), String> {
    let Some((from, rest)) = item.split_once("..") else {
        knots.push(place(item)?);
        return Ok(());
    };
    let (to, count) = rest
        .split_once('/')
        .ok_or_else(|| format!("{item:?} does not say into how many intervals it falls; write {item}/10"))?;
    let (from, to) = (place(from)?, place(to)?);
    let count = count.trim().parse().ok().filter(|n| (1..=MOST).contains(n));
    let count = count.ok_or_else(|| {
        format!("{item:?} has no count of intervals from 1 to {MOST}; write one behind the /")
    })?;
    if from >= to {
        return Err(format!(
            "{item:?} goes from {from} to {to}; write the lower end first"
        ));
    }
    if knots.last() != Some(&from) {
        knots.push(from);
    }
    let step = |i: usize| from + (to - from) * i as f64 / count as f64;
    knots.extend((1..count).map(step).chain([to]));
    Ok(())
}

fn place(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|n: &f64| n.is_finite());
    number.ok_or_else(|| {
        format!(
            "{:?} is no place; write a number, or a range as 0..1/10",
            text.trim()
        )
    })
}

impl Knots {
    /// The lists, for [`tools::knots::block`].
    pub fn lists(&self) -> [&[f64]; 3] {
        self.lists.each_ref().map(|list| &list[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges_are_read_in_their_order() {
        let read = |text: &str| text.parse::<Knots>().map(|k| k.lists);
        let [x, y, z] = read("x=-2, -1,0..1/4,3 ; z=0..1/2").unwrap();
        assert_eq!(x, [-2.0, -1.0, 0.0, 0.25, 0.5, 0.75, 1.0, 3.0]);
        assert!(y.is_empty());
        assert_eq!(z, [0.0, 0.5, 1.0]);
        // A range goes on where the knot before it is.
        assert_eq!(
            read("y=0..1/2,1..4/3").unwrap()[1],
            [0.0, 0.5, 1.0, 2.0, 3.0, 4.0]
        );
        assert_eq!(read("y=0,0..1/1").unwrap()[1], [0.0, 1.0]);
        for (text, part) in [
            ("", "no knots"),
            ("1,2", "names no axis"),
            ("w=1,2", "no axis \"w\""),
            ("x=1;x=2", "twice"),
            ("x=1,two", "\"two\""),
            ("x=nan", "\"nan\""),
            ("x=", "\"\""),
            ("x=0..1", "how many intervals"),
            ("x=0..1/0", "from 1 to"),
            ("x=0..1/99999999", "from 1 to"),
            ("x=1..0/4", "lower end first"),
        ] {
            let why = read(text).unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }
}
