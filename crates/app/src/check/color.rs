/// Colour of `t` in `[0, 1]` on the scale viridis \[Smith15\], from nine of its entries.
pub fn viridis(t: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    let s = if t.is_finite() { t.clamp(0.0, 1.0) } else { 1.0 } * 8.0;
    let i = (s as usize).min(7);
    let w = s - i as f64;
    std::array::from_fn(|c| (STOPS[i][c] * (1.0 - w) + STOPS[i + 1][c] * w).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::viridis;

    #[test]
    fn scale_runs_from_violet_to_yellow_and_takes_anything() {
        assert_eq!(viridis(0.0), [68, 1, 84]);
        assert_eq!(viridis(0.5), [33, 144, 141]);
        assert_eq!(viridis(1.0), [253, 231, 37]);
        assert_eq!(viridis(f64::NAN), viridis(9.0));
        assert_eq!(viridis(-1.0), viridis(0.0));
    }
}
