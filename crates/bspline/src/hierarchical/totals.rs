use crate::Real;

/// Least and largest value.
pub(super) fn min_max<T: Real>(values: &[T]) -> [T; 2] {
    const LANES: usize = 16;
    // Lanes by hand: the order of one accumulator is not for the compiler to change. Comparisons as written here turn
    // into vector instructions; `Float::min` does not.
    let (mut lo, mut hi) = ([T::infinity(); LANES], [T::neg_infinity(); LANES]);
    let raise = |lo: &mut [T], hi: &mut [T], values: &[T]| {
        for ((lo, hi), &v) in lo.iter_mut().zip(hi).zip(values) {
            *lo = if v < *lo { v } else { *lo };
            *hi = if v > *hi { v } else { *hi };
        }
    };
    let (rows, rest) = values.as_chunks::<LANES>();
    for row in rows {
        raise(&mut lo, &mut hi, row);
    }
    raise(&mut lo, &mut hi, rest);
    let least = lo
        .into_iter()
        .fold(T::infinity(), |m, v| if v < m { v } else { m });
    let most = hi
        .into_iter()
        .fold(T::neg_infinity(), |m, v| if v > m { v } else { m });
    [least, most]
}
