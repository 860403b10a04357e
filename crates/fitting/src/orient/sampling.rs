//! Fewer points that stand for all.

/// Most representatives that the iteration works on.
const MOST: usize = 30_000;

/// Points in equal steps of area along the order given, and the area that each stands for; all points if they are few.
///
/// Along the Morton order equal steps are spread evenly over the surface whatever the density, and both sheets of a
/// thin part keep their share.
pub(crate) fn representatives(areas: &[f32]) -> (Vec<usize>, Vec<f32>) {
    if areas.len() <= MOST {
        return ((0..areas.len()).collect(), areas.to_vec());
    }
    let total: f64 = areas.iter().map(|&a| f64::from(a)).sum();
    let step = total / MOST as f64;
    let (mut chosen, mut shares) = (Vec::with_capacity(MOST), Vec::with_capacity(MOST));
    let (mut passed, mut taken) = (0.0f64, 0.0f64);
    for (i, &a) in areas.iter().enumerate() {
        passed += f64::from(a);
        if passed >= (chosen.len() as f64 + 0.5) * step {
            chosen.push(i);
            shares.push((passed - taken) as f32);
            taken = passed;
        }
    }
    (chosen, shares)
}
