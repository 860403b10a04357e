//! Transfer syntaxes: how the elements of a file and its pixels are written (DICOM PS3.5, section 10 and annex A).

use crate::Fault;

/// How elements are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Encoding {
    /// Whether each element carries its value representation.
    pub explicit: bool,
    pub big_endian: bool,
}

impl Encoding {
    /// Of the file's first group and of almost every syntax.
    pub const EXPLICIT: Self = Self {
        explicit: true,
        big_endian: false,
    };
    pub const IMPLICIT: Self = Self {
        explicit: false,
        big_endian: false,
    };
}

/// How pixels are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    /// As numbers.
    Native,
    Rle,
    /// Baseline and lossless.
    Jpeg,
    Jpeg2000,
    JpegLs,
}

/// A transfer syntax.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Syntax {
    pub encoding: Encoding,
    /// Whether everything after the first group is deflated.
    pub deflated: bool,
    /// `None` if its pixels cannot be read, for which [`refusal`] has words.
    pub codec: Option<Codec>,
}

impl Syntax {
    /// The syntax of a unique identifier. All that are not known here write their elements in the usual way.
    pub fn from_uid(uid: &str) -> Self {
        let plain = |encoding| Self {
            encoding,
            deflated: false,
            codec: Some(Codec::Native),
        };
        let coded = |codec| Self {
            codec,
            ..plain(Encoding::EXPLICIT)
        };
        match tail(uid) {
            "" => plain(Encoding::IMPLICIT),
            ".1" => plain(Encoding::EXPLICIT),
            ".2" => plain(Encoding {
                explicit: true,
                big_endian: true,
            }),
            ".1.99" => Self {
                deflated: true,
                ..plain(Encoding::EXPLICIT)
            },
            ".5" => coded(Some(Codec::Rle)),
            ".4.50" | ".4.57" | ".4.70" => coded(Some(Codec::Jpeg)),
            ".4.90" | ".4.91" => coded(Some(Codec::Jpeg2000)),
            ".4.80" | ".4.81" if cfg!(feature = "jpeg-ls") => coded(Some(Codec::JpegLs)),
            _ => coded(None),
        }
    }
}

/// What follows the part that all transfer syntaxes of the standard have in common.
fn tail(uid: &str) -> &str {
    uid.strip_prefix("1.2.840.10008.1.2").unwrap_or("?")
}

/// Says which syntax cannot be read, and how to convert such a file.
pub(super) fn refusal(uid: &str) -> Fault {
    let (name, remedy) = unread(tail(uid));
    Fault::Value {
        what: "the transfer syntax",
        value: format!("{name} ({})", crate::error::excerpt(uid.as_bytes())),
        remedy,
    }
}

const TRANSCODE: &str = "convert the files first, for instance by gdcmconv --raw IN OUT";

fn unread(tail: &str) -> (&'static str, &'static str) {
    match tail {
        ".4.51" => (
            "JPEG extended, 12 bits",
            "convert the files first, for instance by dcmdjpeg IN OUT (DCMTK)",
        ),
        ".4.80" | ".4.81" => (
            "JPEG-LS",
            "convert the files first, for instance by dcmdjpls IN OUT (DCMTK), or build with the feature jpeg-ls",
        ),
        ".4.92" | ".4.93" => ("multi-component JPEG 2000", TRANSCODE),
        ".4.110" | ".4.111" | ".4.112" => ("JPEG XL", TRANSCODE),
        ".4.201" | ".4.202" | ".4.203" => ("high-throughput JPEG 2000", TRANSCODE),
        ".4.94" | ".4.95" | ".4.204" | ".4.205" => (
            "a reference to pixels elsewhere (JPIP)",
            "fetch the files with their pixels",
        ),
        t if t.starts_with(".4.10") => ("a video", "extract its frames with another tool"),
        _ => ("not one that is known", TRANSCODE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_read_is_refused_by_name_with_a_way_out() {
        for (uid, name, remedy) in [
            ("1.2.840.10008.1.2.4.51", "JPEG extended", "dcmdjpeg"),
            ("1.2.840.10008.1.2.4.201", "high-throughput", "gdcmconv"),
            ("1.2.840.10008.1.2.4.102", "video", "frames"),
            ("1.2.3", "1.2.3", "gdcmconv"),
            ("", "not one", "gdcmconv"),
        ] {
            assert_eq!(Syntax::from_uid(uid).codec, None);
            let e = refusal(uid).to_string();
            assert!(e.contains(name) && e.contains(remedy), "{uid}: {e}");
        }
        assert_eq!(
            Syntax::from_uid("1.2.840.10008.1.2.4.80").codec.is_some(),
            cfg!(feature = "jpeg-ls")
        );
    }
}
