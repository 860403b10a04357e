use std::str::FromStr;

use clap::ValueEnum;
use formats::Unit;
use formats::volumes::{DicomOptions, RawLayout, Tilt, Uneven, VolumeOptions, VoxelType};

use super::failure::{Failure, Outcome};

/// Which part of a volume to read, and what its file does not tell.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Reading volumes")]
pub struct VolumeChoice {
    /// Box of voxels to read, ends not included
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1")]
    region: Option<Triple<Range>>,
    /// Read every so many voxels along each axis: one number, or three
    #[arg(long, value_name = "N|X,Y,Z")]
    stride: Option<OneOrThree<usize>>,
    /// Distances between neighbouring voxels in mm, in place of those in the file: one number, or three
    #[arg(long, value_name = "N|X,Y,Z")]
    spacing: Option<OneOrThree<f64>>,
    /// Which volume of a time series, of echoes or channels to read, counted from 0
    #[arg(long, value_name = "N")]
    volume: Option<usize>,
    /// The file has no header: voxels along x (fastest), y and z
    #[arg(long, value_name = "X,Y,Z", requires = "voxel")]
    shape: Option<Triple<usize>>,
    /// The file has no header: type of its voxels, such as uint16 or float32
    #[arg(long, value_name = "TYPE", requires = "shape")]
    voxel: Option<VoxelType>,
    /// The file has no header: its voxels have their high byte first
    #[arg(long, requires = "shape")]
    big_endian: bool,
    /// The file has no header: bytes before the first voxel
    #[arg(long, value_name = "BYTES", requires = "shape", default_value_t = 0)]
    offset: u64,
    /// DICOM: the series to read, by its number or its identifier, where there are several
    #[arg(long, value_name = "NUMBER|UID")]
    series: Option<String>,
    /// DICOM: what to do about slices at uneven distances or missing ones
    #[arg(long, value_enum, default_value_t)]
    uneven: UnevenChoice,
    /// DICOM: what to do about slices of a tilted gantry
    #[arg(long, value_enum, default_value_t)]
    tilt: TiltChoice,
}

/// Slices at uneven distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum UnevenChoice {
    /// Say where and stop.
    #[default]
    Refuse,
    /// Interpolate along the stack, at the smallest distance.
    Resample,
}

/// Slices of a tilted gantry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum TiltChoice {
    /// Leave every voxel where it was measured.
    #[default]
    Keep,
    /// Interpolate onto a grid with right angles.
    Resample,
}

impl VolumeChoice {
    /// The options of the reader; `unit` is what the user says of the file.
    pub fn options(&self, unit: Option<Unit>) -> Outcome<VolumeOptions> {
        let raw = match (&self.shape, self.voxel) {
            (Some(Triple(dims)), Some(voxel)) => {
                let spacing = self.spacing.as_ref().map(|s| s.0);
                if spacing.is_none() && unit.is_some() {
                    return Err(Failure::usage(
                        "--unit of a file without a header needs --spacing, in mm; give it and leave --unit out",
                    ));
                }
                Some(RawLayout {
                    dims: *dims,
                    voxel,
                    big_endian: self.big_endian,
                    offset: self.offset,
                    spacing: spacing.unwrap_or([1.0; 3]),
                    origin: [0.0; 3],
                    unit: if spacing.is_some() {
                        Unit::Millimetre
                    } else {
                        Unit::Unknown
                    },
                    rescale: None,
                })
            }
            _ => None,
        };
        Ok(VolumeOptions {
            region: self
                .region
                .as_ref()
                .map(|r| r.0.map(|Range(from, to)| [from, to])),
            stride: self.stride.as_ref().map_or([1; 3], |s| s.0),
            spacing_mm: if raw.is_some() {
                None
            } else {
                self.spacing.as_ref().map(|s| s.0)
            },
            volume: self.volume,
            raw,
            dicom: DicomOptions {
                series: self.series.clone(),
                uneven: match self.uneven {
                    UnevenChoice::Refuse => Uneven::Refuse,
                    UnevenChoice::Resample => Uneven::Resample,
                },
                tilt: match self.tilt {
                    TiltChoice::Keep => Tilt::Keep,
                    TiltChoice::Resample => Tilt::Resample,
                },
            },
        })
    }
}

/// Three values with commas between.
#[derive(Clone, Debug, PartialEq)]
struct Triple<T>([T; 3]);

/// One value for all axes, or three with commas between.
#[derive(Clone, Debug, PartialEq)]
struct OneOrThree<T>([T; 3]);

/// `from:to`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range(usize, usize);

fn parts<T: FromStr>(s: &str) -> Result<Vec<T>, String> {
    s.split(',')
        .map(|p| p.trim().parse().map_err(|_| format!("{p:?} cannot be read")))
        .collect()
}

impl<T: FromStr> FromStr for Triple<T> {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let all = parts(s)?;
        let n = all.len();
        all.try_into()
            .map(Self)
            .map_err(|_| format!("{n} given; write three with commas between"))
    }
}

impl<T: FromStr + Copy> FromStr for OneOrThree<T> {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match parts(s)?.as_slice() {
            &[one] => Ok(Self([one; 3])),
            &[x, y, z] => Ok(Self([x, y, z])),
            other => Err(format!(
                "{} given; write one, or three with commas between",
                other.len()
            )),
        }
    }
}

impl FromStr for Range {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let ends = s
            .split_once(':')
            .map(|(from, to)| (from.trim().parse(), to.trim().parse()));
        match ends {
            Some((Ok(from), Ok(to))) => Ok(Self(from, to)),
            _ => Err(format!("{s:?} is no range; write 10:90")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grammar_of_triples_and_ranges() {
        assert_eq!(
            "1:5, 2:6,0:9".parse(),
            Ok(Triple([Range(1, 5), Range(2, 6), Range(0, 9)]))
        );
        assert_eq!("2".parse(), Ok(OneOrThree([2usize; 3])));
        assert_eq!("0.5,1,2".parse(), Ok(OneOrThree([0.5, 1.0, 2.0])));
        for bad in ["", "1:2", "1:2,3:4", "1-2,3:4,5:6", "a:b,1:2,3:4", "-1:2,3:4,5:6"] {
            assert!(bad.parse::<Triple<Range>>().is_err(), "{bad:?}");
        }
        assert!(
            "1,2"
                .parse::<OneOrThree<usize>>()
                .unwrap_err()
                .contains("one, or three")
        );
    }
}
