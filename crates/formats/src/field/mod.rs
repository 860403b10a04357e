/// x
pub const MAGIC: [u8; 8] = *b"\x89ICLAY\r\n";
