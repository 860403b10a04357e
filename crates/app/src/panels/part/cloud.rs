//! What is told of points before they are fitted.

use std::path::Path;

use bspline::Aabb;
use egui::{Color32, ColorImage, Sense, TextureHandle, TextureOptions, Ui};
use formats::points::{NormalSource, PointCloud};
use formats::{Kind, ReadLimits};
use glam::DVec3;

use super::{LARGE, WIDE, bytes_of};
use crate::cli::quantity::{human_bytes, human_count, human_number};

/// Points that are drawn, at most.
const DRAWN: usize = 200_000;

/// Bytes that a fit holds, for itself and for each point. Measured: 23 MB for 2 000 points of the bunny, 31 to 37 MB for 50 000 and 98 to 172 MB
/// for 500 000 on spheres and tori, without noise and with 0.3 %.
const BYTES: [f64; 2] = [25e6, 300.0];
/// Seconds of the processor that it takes, and those for each point: on the same, 1 µs where the surface is smooth, 40 µs where all of it
/// is noise.
const SECONDS: f64 = 0.08;
const OF_A_POINT: [f64; 2] = [1e-6, 4e-5];

/// Points as they are before they are fitted.
pub struct Cloud {
    kind: Kind,
    count: usize,
    /// What was not read, in words.
    rest: Option<String>,
    face_count: usize,
    bounds: Aabb,
    unit: formats::Unit,
    normals: NormalSource,
    notes: Vec<String>,
    /// Every so many of them.
    drawn: Vec<DVec3>,
    pictures: [Option<TextureHandle>; 3],
}

impl Cloud {
    /// Looks at a file.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn of(path: &Path, kind: Kind) -> Result<Self, String> {
        Self::by_part(path, kind, LARGE)
    }

    /// The same, of a file that is no longer than this all of it.
    fn by_part(path: &Path, kind: Kind, most: u64) -> Result<Self, String> {
        let limits = ReadLimits::default();
        let length = path.metadata().map_or(0, |file| file.len());
        let part = match length > most {
            true => formats::points::read_part(path, &limits, most / 4).map_err(|e| e.to_string())?,
            false => None,
        };
        let Some(part) = part else {
            let cloud = formats::points::read(path, &limits).map_err(|e| e.to_string())?;
            let mut whole = Self::new(kind, cloud);
            if length > most {
                whole.rest = Some("All of it was read: files of this kind are not read in parts".into());
            }
            return Ok(whole);
        };
        let seen = part.cloud.positions.len();
        let mut cloud = Self::new(kind, part.cloud);
        cloud.count = part.count as usize;
        let about = if part.is_guess { "about " } else { "" };
        cloud.rest = Some(format!(
            "Seen are {} of {about}{} points, from all over the file: {} of {}. Its size, and what else is told, is that of these",
            human_count(seen),
            human_count(cloud.count),
            human_bytes(part.bytes),
            human_bytes(length)
        ));
        Ok(cloud)
    }

    fn new(kind: Kind, cloud: PointCloud) -> Self {
        let all = &cloud.positions;
        let (min, max) = all
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| {
                (min.min(*p), max.max(*p))
            });
        let step = all.len().div_ceil(DRAWN).max(1);
        Self {
            kind,
            count: all.len(),
            rest: None,
            face_count: cloud.face_count,
            bounds: Aabb { min, max },
            unit: cloud.unit,
            normals: cloud.normal_source,
            drawn: all.iter().step_by(step).copied().collect(),
            notes: cloud.notes,
            pictures: [None, None, None],
        }
    }

    /// What it is, seen along three axes, and what it takes.
    pub fn show(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            for axis in 0..3 {
                self.picture(ui, axis);
            }
        });
        if let Some(rest) = &self.rest {
            ui.label(rest);
        }
        for line in self.about() {
            ui.label(line);
        }
        for note in &self.notes {
            ui.weak(note);
        }
        let positions = (self.count * size_of::<DVec3>()) as u64;
        let with_normals = match self.normals {
            NormalSource::None => positions,
            _ => 2 * positions,
        };
        let points = format!("{} points", human_count(self.count));
        bytes_of(ui, &points, with_normals, "thin them out first");
        let bytes = BYTES[0] + BYTES[1] * self.count as f64;
        let [least, most] = OF_A_POINT.map(|each| match SECONDS + each * self.count as f64 {
            short if short < 10.0 => format!("{short:.1}"),
            long => format!("{long:.0}"),
        });
        ui.label(format!(
            "The fit holds about {} and takes {least} to {most} s",
            human_bytes(bytes as u64)
        ))
        .on_hover_text("Of one core: little where the surface is smooth, much where it is noisy");
    }

    fn about(&self) -> Vec<String> {
        let size = self.bounds.max - self.bounds.min;
        let triple = |p: DVec3, between: &str| p.to_array().map(human_number).join(between);
        let unit = match self.unit {
            formats::Unit::Unknown => "of a unit that the file does not tell".into(),
            unit => unit.to_string(),
        };
        let normals = match self.normals {
            NormalSource::None => {
                "No normals: they are found from the points, and which side is inside is guessed".into()
            }
            NormalSource::Stored => "With normals".into(),
            NormalSource::Faces => format!("Normals of its {} faces", human_count(self.face_count)),
        };
        vec![
            format!("{}: {} {unit}", self.kind, triple(size, " × ")),
            format!(
                "From {} to {}",
                triple(self.bounds.min, ", "),
                triple(self.bounds.max, ", ")
            ),
            normals,
        ]
    }

    /// Seen along an axis.
    fn picture(&mut self, ui: &mut Ui, axis: usize) {
        let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
        let size = self.bounds.max - self.bounds.min;
        let [wide, high] = [size[u], size[v]].map(|n| n as f32);
        let scale = WIDE / wide.max(high).max(f32::MIN_POSITIVE);
        let [wide, high] = [wide, high].map(|n| (scale * n).clamp(8.0, WIDE));
        let (drawn, bounds) = (&self.drawn, &self.bounds);
        let picture = self.pictures[axis].get_or_insert_with(|| {
            let image = image(drawn, bounds, [u, v], [wide as usize, high as usize]);
            ui.ctx()
                .load_texture(format!("cloud {axis}"), image, TextureOptions::LINEAR)
        });
        let (rect, _) = ui.allocate_exact_size(egui::vec2(wide, high), Sense::hover());
        let all = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        ui.painter().image(picture.id(), rect, all, Color32::WHITE);
    }
}

/// How many points are where, the second axis up: lighter where there are more.
fn image(points: &[DVec3], bounds: &Aabb, [u, v]: [usize; 2], [wide, high]: [usize; 2]) -> ColorImage {
    let mut counts = vec![0u32; wide * high];
    let size = bounds.max - bounds.min;
    let place = |p: &DVec3, axis: usize, most: usize| {
        let share = (p[axis] - bounds.min[axis]) / size[axis].max(f64::MIN_POSITIVE);
        ((share * most as f64) as usize).min(most - 1)
    };
    for p in points {
        counts[place(p, u, wide) + wide * (high - 1 - place(p, v, high))] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(1).max(1));
    // A few points are to be seen beside many.
    let gray = |n: &u32| match n {
        0 => 0,
        n => (70.0 + 185.0 * (libm::log1p(f64::from(*n)) / libm::log1p(most))) as u8,
    };
    let pixels: Vec<u8> = counts.iter().map(gray).collect();
    ColorImage::from_gray([wide, high], &pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a file that is too long some of the points are seen, and it is said so; of another one all are.
    #[test]
    fn of_a_long_file_a_part_is_seen() {
        let scratch = tempfile::tempdir().unwrap();
        let line = |n: usize| format!("{} {} {}\n", n % 100, n / 100 % 100, n / 10_000);
        let text: String = (0..50_000).map(line).collect();
        let path = scratch.path().join("long.xyz");
        std::fs::write(&path, &text).unwrap();
        let kind = formats::detect(&path).unwrap();
        let whole = Cloud::by_part(&path, kind, 1 << 20).unwrap();
        assert_eq!((whole.count, &whole.rest), (50_000, &None));
        let part = Cloud::by_part(&path, kind, 100_000).unwrap();
        let rest = part.rest.unwrap();
        assert!((49_000..51_000).contains(&part.count), "{}", part.count);
        assert!(
            rest.starts_with("Seen are ")
                && rest.contains(" of about ")
                && rest.contains("from all over the file"),
            "{rest}"
        );
        assert!((1000..10_000).contains(&part.drawn.len()), "{}", part.drawn.len());
        // The first layer and the last one.
        assert_eq!((part.bounds.min.z, part.bounds.max.z), (0.0, 4.0));

        let path = scratch.path().join("long.obj");
        std::fs::write(
            &path,
            text.lines().map(|line| format!("v {line}\n")).collect::<String>(),
        )
        .unwrap();
        let packed = Cloud::by_part(&path, Kind::Cloud(formats::PointFormat::Obj), 100_000);
        let rest = packed.unwrap().rest.unwrap();
        assert!(rest.contains("All of it was read"), "{rest}");
    }
}
