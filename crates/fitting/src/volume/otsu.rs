use super::quantile::quantiles;
use super::voxels::{Number, Voxels, each};

/// Classes of the histogram.
const BINS: usize = 256;

/// Hounsfield units that no matter is below, noise included.
const PADDING: f32 = -1100.0;

/// Share of the voxels that makes a value padding.
const MANY: f64 = 0.01;

/// The density that parts a volume into two classes of least variance, such as air and tissue: a first guess at
/// where a surface should lie.
///
/// Maximizes the variance between the classes, `w₀ w₁ (μ₀ - μ₁)²` [Otsu79 eq. 14], over 256 thresholds between
/// the 1st and the 99th percentile; densities beyond them count as the nearer end. `None` where these
/// percentiles coincide: there is one class. [Padding](padding) does not count.
///
/// # Panics
/// If `values` is empty.
pub fn otsu_threshold<'a>(values: impl Into<Voxels<'a>>) -> Option<f64> {
    each!(values.into(), values, _order => {
        match padding_of(values) {
            None => threshold(values),
            Some(padding) => {
                let measured = values.iter().copied();
                let measured: Vec<_> = measured.filter(|v| v.float() != padding).collect();
                threshold(&measured)
            }
        }
    })
}

/// What voxels hold that a CT scanner did not measure, outside of its circle: the least value, if it lies far below that of
/// air and many voxels have it.
///
/// # Panics
/// If `values` is empty.
pub fn padding<'a>(values: impl Into<Voxels<'a>>) -> Option<f64> {
    each!(values.into(), values, _order => padding_of(values).map(f64::from))
}

fn padding_of<N: Number>(values: &[N]) -> Option<f32> {
    let least = values.iter().map(|v| v.float()).fold(f32::INFINITY, f32::min);
    if least > PADDING {
        return None;
    }
    let count = values.iter().filter(|v| v.float() == least).count();
    (count as f64 >= MANY * values.len() as f64 && count < values.len()).then_some(least)
}

fn threshold<N: Number>(values: &[N]) -> Option<f64> {
    let [low, high] = quantiles(values, [0.01, 0.99]).map(f64::from);
    let width = (high - low) / BINS as f64;
    if width <= 0.0 {
        return None;
    }
    let mut histogram = [0u64; BINS];
    for &v in values {
        let bin = ((f64::from(v.float()) - low) / width).clamp(0.0, (BINS - 1) as f64);
        histogram[bin as usize] += 1;
    }
    let total = values.len() as f64;
    let moment: f64 = histogram
        .iter()
        .enumerate()
        .map(|(i, &n)| i as f64 * n as f64)
        .sum();
    let (mut below, mut moment_below) = (0.0, 0.0);
    let (mut best, mut first, mut last) = (0.0, 0, 0);
    for (i, &n) in histogram[..BINS - 1].iter().enumerate() {
        below += n as f64;
        moment_below += i as f64 * n as f64;
        let above = total - below;
        if below == 0.0 || above == 0.0 {
            continue;
        }
        let apart = moment_below / below - (moment - moment_below) / above;
        let between = below * above * apart * apart;
        if between > best {
            (best, first, last) = (between, i, i);
        } else if between == best {
            last = i;
        }
    }
    // Between two separate heaps every threshold is as good: the middle one.
    Some(low + width * ((first + last) as f64 * 0.5 + 1.0))
}

#[cfg(test)]
mod tests {
    use super::{otsu_threshold, padding};

    #[test]
    fn two_heaps_are_parted_in_the_middle() {
        let values: Vec<f32> = (0..1000).map(|i| if i % 3 == 0 { 10.0 } else { 90.0 }).collect();
        let threshold = otsu_threshold(&values).expect("two classes");
        assert!((threshold - 50.0).abs() < 0.5, "{threshold}");
    }

    #[test]
    fn padding_of_a_scanner_is_no_class() {
        let mut values: Vec<f32> = (0..1000)
            .map(|i| if i % 3 == 0 { 40.0 } else { -1000.0 } + (i % 7) as f32)
            .collect();
        let measured = otsu_threshold(&values).expect("two classes");
        assert_eq!(padding(&values), None);
        values.extend([-3024.0; 400]);
        assert_eq!(padding(&values), Some(-3024.0));
        assert_eq!(otsu_threshold(&values), Some(measured));
        assert_eq!(padding(&[-3024.0_f32; 20][..]), None);
    }

    #[test]
    fn outliers_do_not_move_the_threshold_and_constants_have_none() {
        let mut values: Vec<f32> = (0..1000).map(|i| if i % 3 == 0 { 10.0 } else { 90.0 }).collect();
        values[5] = 1e9;
        assert!((otsu_threshold(&values).unwrap() - 50.0).abs() < 0.5);
        assert_eq!(otsu_threshold(&[7.0_f32; 20][..]), None);
    }
}
