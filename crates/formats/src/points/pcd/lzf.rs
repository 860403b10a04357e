//! Decompression of LZF, the packing of PCD [M. Lehmann, liblzf].

use crate::Fault;

/// Bytes that one byte can become: three of a back reference make up to 264.
pub(super) const MAX_RATIO: u64 = 88;

/// A stream that unpacks to `bytes`, which it holds as they are.
pub(in crate::points) fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 32 + 1);
    for run in bytes.chunks(32) {
        out.push(run.len() as u8 - 1);
        out.extend_from_slice(run);
    }
    out
}

/// Unpacks all of `packed` into exactly `out`.
pub(super) fn unpack(packed: &[u8], out: &mut [u8]) -> Result<(), Fault> {
    let damaged = |at: usize| Fault::Damaged {
        what: format!("the LZF stream does not hold at byte {at} of it"),
    };
    let (mut from, mut to) = (0, 0);
    while from < packed.len() {
        let at = from;
        let control = usize::from(packed[from]);
        from += 1;
        if control < 32 {
            let run = control + 1;
            let source = packed.get(from..from + run).ok_or_else(|| damaged(at))?;
            out.get_mut(to..to + run)
                .ok_or_else(|| damaged(at))?
                .copy_from_slice(source);
            from += run;
            to += run;
            continue;
        }
        let mut next = || {
            let byte = packed.get(from).copied().map(usize::from);
            from += 1;
            byte.ok_or_else(|| damaged(at))
        };
        let length = match control >> 5 {
            7 => 7 + next()?,
            short => short,
        } + 2;
        let distance = ((control & 31) << 8) + next()? + 1;
        if distance > to || to + length > out.len() {
            return Err(damaged(at));
        }
        // Byte by byte: a reference may reach into what it writes.
        for i in to..to + length {
            out[i] = out[i - distance];
        }
        to += length;
    }
    if to < out.len() {
        return Err(Fault::Truncated {
            what: "the LZF stream".into(),
            needed: out.len() as u64,
            found: to as u64,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_references_that_overlap_are_unpacked() {
        // "abc", then 3 back for 9 bytes; then 1 back for 2 + 1.
        let packed = [2, b'a', b'b', b'c', 0b1110_0000, 0, 2, 0b0010_0000, 0];
        let mut out = [0; 15];
        unpack(&packed, &mut out).unwrap();
        assert_eq!(&out, b"abcabcabcabcccc");
    }

    #[test]
    fn streams_that_reach_outside_are_refused() {
        for packed in [
            &[5, 1][..],
            &[0, 1, 0b0010_0000],
            &[0, 1, 0b0010_0000, 9],
            &[0, 1, 0b1110_0000, 255, 0],
            &[0, 1],
        ] {
            assert!(unpack(packed, &mut [0; 8]).is_err(), "{packed:?}");
        }
    }
}
