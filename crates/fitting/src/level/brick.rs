//! Bricks of 4³ coefficients, by which the levels near a surface are held.

/// Coefficients along one edge of a brick: half as many as in the field's bricks, since of a deep brick of those hardly one
/// function in a hundred is active.
pub(crate) const BRICK: usize = 4;
/// Coefficients in a brick.
pub(crate) const BRICK_LEN: usize = BRICK * BRICK * BRICK;
/// Edge of a brick with all that its cells read.
pub(crate) const HALO: usize = BRICK + 3;
/// Coefficients in a brick with halo.
pub(crate) const HALO_LEN: usize = HALO * HALO * HALO;
/// Coefficients of a brick with halo from one x to the next, and from one y to the next.
pub(crate) const STRIDES: [usize; 2] = [HALO * HALO, HALO];

/// Place of a brick on its level, in bricks.
pub(crate) type Key = [u32; 3];

/// The brick that holds a cell or a slot.
pub(crate) fn key_of(at: [u32; 3]) -> Key {
    at.map(|c| c / BRICK as u32)
}

/// Number of a cell or a slot in its brick.
#[inline]
pub(crate) fn slot_of(at: [u32; 3]) -> usize {
    let [x, y, z] = at.map(|c| c as usize % BRICK);
    (x * BRICK + y) * BRICK + z
}

/// Where the 4³ coefficients of a cell start in its brick's halo.
#[inline]
pub(crate) fn halo_start(cell: [u32; 3]) -> usize {
    let [x, y, z] = cell.map(|c| c as usize % BRICK);
    (x * HALO + y) * HALO + z
}
