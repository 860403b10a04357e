//! Numbers of NumPy arrays, lent to threads that work without the interpreter.
#![allow(
    unsafe_code,
    reason = "memory of NumPy is lent beyond the borrow that the interpreter's lock stands for"
)]

use std::ops::Deref;

use glam::{DAffine3, DMat3, DVec3};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::failure::Failure;

/// The numbers of an array, which lives at least as long.
pub struct Lent<T> {
    start: *const T,
    len: usize,
    _owner: Py<PyArray1<T>>,
}

// SAFETY: the memory belongs to the array, which is held and is only read here. Nothing but numbers lies in it: a caller who
// changes it meanwhile, against the documentation, gets an answer about other numbers.
unsafe impl<T: Sync> Send for Lent<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Lent<T> {}

impl<T: Element> Lent<T> {
    /// Lends a dense array.
    ///
    /// # Errors
    /// If it is not dense.
    pub fn new(array: &Bound<'_, PyArray1<T>>) -> PyResult<Self> {
        if !array.is_contiguous() {
            return Err(Failure::value("the array is not dense; copy it first").into());
        }
        Ok(Self {
            start: array.data(),
            len: array.len(),
            _owner: array.clone().unbind(),
        })
    }
}

impl<T> Deref for Lent<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        if self.len == 0 {
            return &[];
        }
        // SAFETY: NumPy has laid out `len` aligned elements there, as its flags of a dense, aligned array said, and the held
        // array keeps them there: NumPy resizes no array that others refer to, unless it is told not to look.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }
}

/// Rows of three numbers.
pub fn vectors(array: &Bound<'_, PyArray2<f64>>) -> PyResult<Vec<DVec3>> {
    let rows = array.readonly();
    let rows = rows.as_array();
    match rows.ncols() {
        3 => Ok(rows
            .rows()
            .into_iter()
            .map(|r| DVec3::new(r[0], r[1], r[2]))
            .collect()),
        n => Err(Failure::value(format!("points have 3 coordinates, not {n}")).into()),
    }
}

/// Corners of triangles, each below `count`.
pub fn corners(array: &Bound<'_, PyArray2<u32>>, count: usize) -> PyResult<Vec<[u32; 3]>> {
    let rows = array.readonly();
    let rows = rows.as_array();
    if rows.ncols() != 3 {
        return Err(Failure::value(format!("triangles have 3 corners, not {}", rows.ncols())).into());
    }
    if let Some(corner) = rows.iter().find(|&&c| c as usize >= count) {
        return Err(Failure::value(format!(
            "a triangle has corner {corner}, and there are {count} vertices; they are counted from 0"
        ))
        .into());
    }
    Ok(rows.rows().into_iter().map(|r| [r[0], r[1], r[2]]).collect())
}

/// An array of so many columns of what is laid out in rows already.
pub fn rows<'py, T: Element>(
    py: Python<'py>,
    flat: Vec<T>,
    columns: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let count = flat.len() / columns;
    PyArray1::from_vec(py, flat).reshape([count, columns])
}

/// Points as rows.
pub fn points<'py>(py: Python<'py>, points: &[DVec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    rows(py, points.iter().flat_map(|p| p.to_array()).collect(), 3)
}

/// A map written as the first three rows of its matrix.
pub fn affine(rows: [[f64; 4]; 3]) -> DAffine3 {
    let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
    DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

/// The first three rows of the matrix of a map.
pub fn matrix_rows(map: &DAffine3) -> [[f64; 4]; 3] {
    [0, 1, 2].map(|r| {
        [0, 1, 2, 3].map(|c| {
            if c < 3 {
                map.matrix3.col(c)[r]
            } else {
                map.translation[r]
            }
        })
    })
}
