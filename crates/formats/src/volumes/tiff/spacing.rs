//! What the tags of a TIFF stack say about its slices and lengths.

use glam::{DAffine3, DVec3};

use super::page::{Description, Page};
use crate::volumes::geometry::{checked_dims, usable};
use crate::volumes::volume::{Orientation, VolumeHeader};
use crate::{Fault, Unit};

impl Description {
    /// A value of ImageJ's description.
    fn imagej(&self, key: &str) -> Option<&str> {
        if !self.text.starts_with("ImageJ=") {
            return None;
        }
        let mut pairs = self.text.lines().filter_map(|l| l.split_once('='));
        pairs.find(|(k, _)| k.trim() == key).map(|(_, v)| v.trim())
    }

    fn imagej_count(&self, key: &str) -> Result<usize, Fault> {
        self.imagej(key).map_or(Ok(1), |v| {
            v.parse().map_err(|_| Fault::Value {
                what: "a count in ImageJ's description",
                value: format!("{key}={}", crate::error::excerpt(v.as_bytes())),
                remedy: "is the file damaged?",
            })
        })
    }

    /// Number of slices, if the file has fewer pages because the voxels of later ones have no directory.
    pub fn pages_without_headers(&self, pages: usize) -> Result<Option<usize>, Fault> {
        for key in ["channels", "frames"] {
            let count = self.imagej_count(key)?;
            if count > 1 {
                return Err(Fault::Value {
                    what: "the number of channels or time steps",
                    value: format!("{count} {key}"),
                    remedy: "a volume has one number a voxel; save one channel and one time step",
                });
            }
        }
        // Written by tifffile: a page that stands for many.
        if self.text.contains("\"truncated\": true") {
            return Err(Fault::Value {
                what: "the description",
                value: "that of a truncated series".into(),
                remedy: "save the stack with one page a slice",
            });
        }
        let images = self.imagej_count("images")?;
        match self.imagej("images") {
            Some(_) if images > pages && pages == 1 => Ok(Some(images)),
            Some(_) if images != pages => Err(Fault::Value {
                what: "the number of pages",
                value: format!("{pages}, where ImageJ's description says {images}"),
                remedy: "pages are missing; save the stack again",
            }),
            _ => Ok(None),
        }
    }

    /// The header of a stack of `count` slices.
    pub fn header(&self, page: &Page, count: usize, notes: &mut Vec<String>) -> Result<VolumeHeader, Fault> {
        let count = i64::try_from(count).unwrap_or(i64::MAX);
        notes.push("TIFF gives no orientation; axes are taken as stored, the first voxel as origin".into());
        let (spacing, unit) = match self.spacing_mm(notes) {
            Some(spacing) => (spacing, Unit::Millimetre),
            None => (DVec3::ONE, Unit::Unknown),
        };
        Ok(VolumeHeader {
            dims: checked_dims([page.width.into(), page.height.into(), count])?,
            world_from_voxel: usable(DAffine3::from_scale(spacing))?,
            unit,
            orientation: Orientation::Spacings,
            stored: page.voxel,
            rescale: None,
        })
    }

    /// All three distances in millimetres, or none: one of them is never guessed from the others.
    fn spacing_mm(&self, notes: &mut Vec<String>) -> Option<DVec3> {
        let pixel = self
            .resolution
            .map(|r| r.filter(|r| *r > 0.0 && r.is_finite()).map(|r| 1.0 / r));
        let unit = match (self.imagej("unit").and_then(unit_mm), self.unit) {
            (Some(mm), _) => Some(mm),
            (None, Some(2)) => Some(25.4),
            (None, Some(3)) => Some(10.0),
            _ => None,
        };
        let slice = self
            .imagej("spacing")
            .and_then(|s| s.parse::<f64>().ok())
            .map(f64::abs);
        match (pixel, slice.filter(|s| *s > 0.0 && s.is_finite()), unit) {
            ([Some(x), Some(y)], Some(z), Some(mm)) => Some(DVec3::new(x, y, z) * mm),
            ([Some(x), Some(y)], None, Some(mm)) => {
                notes.push(format!(
                    "pixels are {} x {} mm by the tags, but nothing gives the distance of the slices; lengths are \
                     in voxels",
                    x * mm,
                    y * mm
                ));
                None
            }
            _ => {
                notes.push("the tags name no distances with a unit; lengths are in voxels".into());
                None
            }
        }
    }
}

/// Millimetres of a unit as ImageJ names it.
fn unit_mm(name: &str) -> Option<f64> {
    Some(match name.to_ascii_lowercase().as_str() {
        "nm" => 1e-6,
        "um" | "µm" | "μm" | "\\u00b5m" | "micron" | "microns" | "micrometer" => 1e-3,
        "mm" | "millimeter" => 1.0,
        "cm" | "centimeter" => 10.0,
        "m" | "meter" => 1e3,
        "inch" | "in" => 25.4,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(text: &str, resolution: f64, unit: u64) -> Description {
        Description {
            text: text.into(),
            resolution: [Some(resolution); 2],
            unit: Some(unit),
        }
    }

    #[test]
    fn lengths_are_known_only_with_all_three_and_a_unit() {
        let spacing = |text: &str, unit| described(text, 4.0, unit).spacing_mm(&mut Vec::new());
        assert_eq!(
            spacing("ImageJ=1.5\nunit=mm\nspacing=2.0\n", 1),
            Some(DVec3::new(0.25, 0.25, 2.0))
        );
        let micro = spacing("ImageJ=1.5\nunit=\\u00B5m\nspacing=-2.0\n", 1).unwrap();
        assert!((micro - DVec3::new(25e-5, 25e-5, 2e-3)).length() < 1e-15);
        assert_eq!(
            spacing("ImageJ=1.5\nspacing=2\n", 3),
            Some(DVec3::new(2.5, 2.5, 20.0))
        );
        for (text, unit) in [
            ("ImageJ=1.5\nunit=pixel\nspacing=2\n", 1),
            ("ImageJ=1.5\nunit=mm\n", 1),
            ("ImageJ=1.5\nunit=mm\nspacing=nan\n", 1),
            ("ImageJ=1.5\nspacing=2\n", 1),
            ("unit=mm\nspacing=2\n", 3),
            ("", 2),
        ] {
            assert_eq!(spacing(text, unit), None, "{text:?} {unit}");
        }
    }

    #[test]
    fn slices_that_the_description_counts_and_the_file_lacks_are_noticed() {
        let pages = |text: &str, pages| described(text, 1.0, 1).pages_without_headers(pages);
        assert_eq!(pages("ImageJ=1.5\nimages=7\n", 7).unwrap(), None);
        assert_eq!(pages("ImageJ=1.5\nimages=7\n", 1).unwrap(), Some(7));
        assert_eq!(pages("ImageJ=1.5\n", 1).unwrap(), None);
        assert!(pages("ImageJ=1.5\nimages=7\n", 6).is_err());
        assert!(pages("ImageJ=1.5\nimages=x\n", 6).is_err());
        assert!(pages("ImageJ=1.5\nimages=8\nchannels=2\n", 8).is_err());
        assert!(pages("{\"shape\": [3, 4], \"truncated\": true}", 1).is_err());
    }
}
