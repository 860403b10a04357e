//! A grid below the scene, and the axes of the world.

use glam::DVec3;

use super::Stretch;

/// Lines on each side of the middle.
const LINES: i32 = 10;
/// Red, green and blue as people know axes, light enough for each eye to tell.
const AXES: [[u8; 4]; 3] = [[230, 90, 80, 255], [120, 200, 90, 255], [90, 150, 255, 255]];

/// A grid below a ball round a centre, its sides 1, 2 or 5 times a power of ten, and the axes as long as a side of five of them; places are
/// told from `origin`. Also the side of its squares.
pub fn floor(center: DVec3, radius: f64, up: DVec3, origin: DVec3) -> (Vec<Stretch>, f64) {
    let side = round(radius / 4.0);
    let right = if up.x.abs() > 0.9 { DVec3::Y } else { DVec3::X };
    let back = up.cross(right);
    // On whole multiples of its sides.
    let snapped = |along: DVec3| (center.dot(along) / side).round() * side;
    let middle = snapped(right) * right + snapped(back) * back + (center.dot(up) - radius) * up;
    let place = |a: i32, b: i32| {
        let p = middle + f64::from(a) * side * right + f64::from(b) * side * back;
        (p - origin).as_vec3().to_array()
    };
    let mut stretches = Vec::new();
    for n in -LINES..=LINES {
        let color = [170, 180, 195, if n % 5 == 0 { 120 } else { 55 }];
        for [start, end] in [[(n, -LINES), (n, LINES)], [(-LINES, n), (LINES, n)]] {
            stretches.push(Stretch {
                start: place(start.0, start.1),
                end: place(end.0, end.1),
                color,
            });
        }
    }
    for (axis, color) in DVec3::AXES.into_iter().zip(AXES) {
        stretches.push(Stretch {
            start: place(0, 0),
            end: (glam::Vec3::from(place(0, 0)) + (5.0 * side * axis).as_vec3()).to_array(),
            color,
        });
    }
    (stretches, side)
}

/// The largest of 1, 2 and 5 times a power of ten that is not above a length.
fn round(most: f64) -> f64 {
    let power = libm::exp10(most.log10().floor());
    let digit = [5.0, 2.0, 1.0].into_iter().find(|d| d * power <= most);
    digit.unwrap_or(1.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_lies_below_the_scene_whatever_is_up() {
        for up in [DVec3::Y, DVec3::Z, DVec3::X] {
            let center = DVec3::new(3.0, -7.0, 11.0);
            let (stretches, side) = floor(center, 45.0, up, center);
            assert_eq!(side, 10.0);
            let grid = &stretches[..stretches.len() - 3];
            for p in grid.iter().flat_map(|s| [s.start, s.end]) {
                let p = glam::Vec3::from(p).as_dvec3();
                assert!((p.dot(up) + 45.0).abs() < 1e-4, "{p}");
            }
        }
    }
}
