use sprs::CsMat;

/// Unknowns that are not divided further.
const LEAF: usize = 48;

/// An order of elimination that fills little: the unknowns, which lie at `places` of a lattice, are halved along the longest
/// side of their box, those of one half that the other one reaches come last, and both halves are ordered alike
/// \[George73\]. Returns the number of the unknown at each place of the order.
///
/// # Panics
/// If there is not one place per row of the matrix.
pub fn nested_dissection(matrix: &CsMat<f64>, places: &[[usize; 3]]) -> Vec<usize> {
    assert_eq!(matrix.rows(), places.len(), "a place per unknown");
    let mut dissection = Dissection {
        matrix,
        places,
        half: vec![Half::Elsewhere; places.len()],
        order: Vec::with_capacity(places.len()),
    };
    dissection.divide((0..places.len()).collect());
    dissection.order
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    Elsewhere,
    Low,
    High,
}

struct Dissection<'a> {
    matrix: &'a CsMat<f64>,
    places: &'a [[usize; 3]],
    half: Vec<Half>,
    order: Vec<usize>,
}

impl Dissection<'_> {
    fn divide(&mut self, unknowns: Vec<usize>) {
        if unknowns.len() <= LEAF {
            self.order.extend(unknowns);
            return;
        }
        let ends = |a: usize| {
            let along = unknowns.iter().map(|&i| self.places[i][a]);
            let (low, high) = along.fold((usize::MAX, 0), |(l, h), p| (l.min(p), h.max(p)));
            high - low
        };
        let lengths = [0, 1, 2].map(ends);
        let axis = (0..3).fold(0, |best, a| if lengths[a] > lengths[best] { a } else { best });
        let mut along: Vec<usize> = unknowns.iter().map(|&i| self.places[i][axis]).collect();
        along.sort_unstable();
        let middle = along[along.len() / 2];
        if middle == along[0] {
            self.order.extend(unknowns);
            return;
        }
        for &i in &unknowns {
            self.half[i] = if self.places[i][axis] < middle {
                Half::Low
            } else {
                Half::High
            };
        }
        let half = &self.half;
        let reached = |i: usize| {
            let row = self.matrix.outer_view(i).expect("a row per unknown");
            row.indices().iter().any(|&j| half[j] == Half::High)
        };
        let (low, high): (Vec<usize>, Vec<usize>) = unknowns.iter().partition(|&&i| half[i] == Half::Low);
        let (separator, low): (Vec<usize>, Vec<usize>) = low.into_iter().partition(|&i| reached(i));
        for i in unknowns {
            self.half[i] = Half::Elsewhere;
        }
        self.divide(low);
        self.divide(high);
        self.order.extend(separator);
    }
}
