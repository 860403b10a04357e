use std::str::FromStr;

use clap::ValueEnum;
use formats::volumes::{DicomOptions, RawLayout, Tilt, Uneven, VolumeFormat, VolumeOptions, VoxelType};
use formats::{Kind, Unit};

use super::failure::{Failure, Outcome};
use super::quantity::{count, positive};

/// Which part of a volume to read, and what its file does not tell.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Reading volumes")]
pub struct VolumeChoice {
    /// Box of voxels to read, ends not included
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1")]
    region: Option<Triple<Range>>,
    /// Read every so many voxels along each axis: one number, or three
    #[arg(long, value_name = "N|X,Y,Z", allow_hyphen_values = true)]
    stride: Option<OneOrThree<Step>>,
    /// Distances between neighbouring voxels in mm, in place of those in the file: one number, or three
    #[arg(long, value_name = "N|X,Y,Z", allow_hyphen_values = true)]
    spacing: Option<OneOrThree<Length>>,
    /// Which volume of a time series, of echoes or channels to read, counted from 0
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true)]
    volume: Option<usize>,
    /// The file has no header: voxels along x (fastest), y and z
    #[arg(long = "shape", value_name = "X,Y,Z", requires = "voxel")]
    dims: Option<Triple<usize>>,
    /// The file has no header: type of its voxels, such as uint16 or float32
    #[arg(long, value_name = "TYPE", requires = "dims")]
    voxel: Option<VoxelType>,
    /// The file has no header: its voxels have their high byte first
    #[arg(long, requires = "dims")]
    big_endian: bool,
    /// The file has no header: bytes before the first voxel
    #[arg(long, value_name = "BYTES", requires = "dims", default_value_t = 0, value_parser = whole::<u64>, allow_negative_numbers = true)]
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
    /// The whole of a volume, one of several in its file.
    pub fn whole(series: Option<String>, volume: Option<usize>) -> Self {
        Self {
            series,
            volume,
            ..Self::default()
        }
    }

    /// Refuses choices for DICOM series where the volume is none.
    pub fn suits(&self, kind: Kind) -> Outcome {
        let (option, value) = if let Some(series) = &self.series {
            ("--series", series.clone())
        } else if self.uneven != UnevenChoice::Refuse {
            ("--uneven", "resample".into())
        } else if self.tilt != TiltChoice::Keep {
            ("--tilt", "resample".into())
        } else {
            return Ok(());
        };
        match kind {
            Kind::Volume(VolumeFormat::Dicom) => Ok(()),
            kind => Err(Failure::usage(format!(
                "{option} {value}: is for DICOM series, and this is a {kind}; leave it out"
            ))),
        }
    }

    /// Reads every so many voxels, unless the user has chosen how many.
    pub fn stride_by_default(&mut self, stride: [usize; 3]) {
        self.stride.get_or_insert(OneOrThree(stride.map(Step)));
    }

    /// Takes away `--spacing` where it is not that of a file without a header.
    pub fn take_spacing_of_other(&mut self) -> Option<[f64; 3]> {
        if self.dims.is_some() {
            return None;
        }
        self.spacing.take().map(|s| s.0.map(|Length(s)| s))
    }

    fn spacing(&self) -> Option<[f64; 3]> {
        self.spacing.as_ref().map(|s| s.0.map(|Length(s)| s))
    }

    /// The options of the reader; `unit` is what the user says of the file.
    pub fn options(&self, unit: Option<Unit>) -> Outcome<VolumeOptions> {
        let raw = match (&self.dims, self.voxel) {
            (Some(Triple(dims)), Some(voxel)) => {
                let spacing = self.spacing();
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
            stride: self.stride.as_ref().map_or([1; 3], |s| s.0.map(|Step(n)| n)),
            spacing_mm: if raw.is_some() { None } else { self.spacing() },
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

pub fn whole<T: FromStr>(s: &str) -> Result<T, String> {
    s.parse()
        .map_err(|_| "write a whole number in digits, 0 or more".into())
}

/// Three values with commas between.
#[derive(Clone, Debug, PartialEq)]
struct Triple<T>([T; 3]);

/// One value for all axes, or three with commas between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneOrThree<T>(pub [T; 3]);

/// A length above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length(pub f64);

impl FromStr for Length {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        positive(s).map(Self)
    }
}

/// A whole number above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step(usize);

impl FromStr for Step {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        count(s).map(|n| Self(n.get()))
    }
}

/// `from:to`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range(usize, usize);

fn parts<T: FromStr<Err: ToString>>(s: &str) -> Result<Vec<T>, String> {
    s.split(',')
        .map(|p| {
            p.trim()
                .parse()
                .map_err(|e: T::Err| format!("{p:?}: {}", e.to_string()))
        })
        .collect()
}

impl<T: FromStr<Err: ToString>> FromStr for Triple<T> {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let all = parts(s)?;
        let n = all.len();
        all.try_into()
            .map(Self)
            .map_err(|_| format!("{n} of three values given; write all three with commas between"))
    }
}

impl<T: FromStr<Err: ToString> + Copy> FromStr for OneOrThree<T> {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match parts(s)?.as_slice() {
            &[one] => Ok(Self([one; 3])),
            &[x, y, z] => Ok(Self([x, y, z])),
            other => Err(format!(
                "{} values given; write one, or three with commas between",
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
        assert_eq!("2".parse(), Ok(OneOrThree([Step(2); 3])));
        assert_eq!("0.5,1,2".parse(), Ok(OneOrThree([0.5, 1.0, 2.0].map(Length))));
        assert!(
            "1,0,1"
                .parse::<OneOrThree<Length>>()
                .unwrap_err()
                .contains("above zero")
        );
        for bad in ["", "1:2", "1:2,3:4", "1-2,3:4,5:6", "a:b,1:2,3:4", "-1:2,3:4,5:6"] {
            assert!(bad.parse::<Triple<Range>>().is_err(), "{bad:?}");
        }
        assert!(
            "1,2"
                .parse::<OneOrThree<Step>>()
                .unwrap_err()
                .contains("one, or three")
        );
    }
}
