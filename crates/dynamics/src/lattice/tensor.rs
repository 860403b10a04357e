use std::ops::Range;

use bspline::Real;
use bspline::vectorized;

use super::banded::{Banded, BandedLanes, combine};

/// The tensor product of three banded matrices, applied axis by axis to arrays with z fastest.
#[derive(Clone, Debug)]
pub(crate) struct TensorProduct<T> {
    x: Banded<T>,
    y: Banded<T>,
    z: BandedLanes<T>,
    /// Begin with the axis that shrinks the array, end with the one that lets it grow.
    order: Order,
}

/// Which axis comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// x, y, z: for products that shrink the array.
    SlowFirst,
    /// z, y, x: for products that let it grow.
    FastFirst,
}

/// Scratch for tensor products: what lies between the axes.
#[derive(Clone, Debug, Default)]
pub struct TensorWorkspace<T> {
    first: Vec<T>,
    second: Vec<T>,
}

impl<T: Real> TensorWorkspace<T> {
    /// No room yet; the first product makes it.
    pub fn new() -> Self {
        Self::default()
    }

    fn split(&mut self, first: usize, second: usize) -> (&mut [T], &mut [T]) {
        if self.first.len() < first {
            self.first.resize(first, T::zero());
        }
        if self.second.len() < second {
            self.second.resize(second, T::zero());
        }
        (&mut self.first[..first], &mut self.second[..second])
    }
}

impl<T: Real> TensorProduct<T> {
    /// `X ⊗ Y ⊗ Z`.
    pub fn new([x, y, z]: [&Banded<T>; 3]) -> Self {
        let grows = x.rows() * y.rows() * z.rows() >= x.columns() * y.columns() * z.columns();
        Self {
            x: x.clone(),
            y: y.clone(),
            z: BandedLanes::new(z),
            order: if grows { Order::FastFirst } else { Order::SlowFirst },
        }
    }

    /// Lengths along the axes of what comes in.
    pub fn input_dims(&self) -> [usize; 3] {
        [self.x.columns(), self.y.columns(), self.z.columns()]
    }

    /// Lengths along the axes of what comes out.
    pub fn output_dims(&self) -> [usize; 3] {
        [self.x.rows(), self.y.rows(), self.z.rows()]
    }

    /// `output = (X ⊗ Y ⊗ Z) input`. Allocates only when `w` has not seen this size.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn apply(&self, input: &[T], output: &mut [T], w: &mut TensorWorkspace<T>) {
        let ([ix, iy, iz], [ox, oy, oz]) = (self.input_dims(), self.output_dims());
        assert_eq!(input.len(), ix * iy * iz, "input of the tensor product");
        assert_eq!(output.len(), ox * oy * oz, "output of the tensor product");
        match self.order {
            Order::FastFirst => {
                let (along_z, along_y) = w.split(ix * iy * oz, ix * oy * oz);
                vectorized(
                    #[inline(always)]
                    || {
                        self.z.apply_lines(input, along_z);
                        let planes = along_y.chunks_exact_mut(oy * oz);
                        for (a, b) in along_z.chunks_exact(iy * oz).zip(planes) {
                            self.y.apply_planes(oz, a, b);
                        }
                        self.x.apply_planes(oy * oz, along_y, output);
                    },
                );
            }
            Order::SlowFirst => {
                let (along_x, along_y) = w.split(ox * iy * iz, ox * oy * iz);
                vectorized(
                    #[inline(always)]
                    || {
                        self.x.apply_planes(iy * iz, input, along_x);
                        let planes = along_y.chunks_exact_mut(oy * iz);
                        for (a, b) in along_x.chunks_exact(iy * iz).zip(planes) {
                            self.y.apply_planes(iz, a, b);
                        }
                        self.z.apply_lines(along_y, output);
                    },
                );
            }
        }
    }

    /// Rows of the first two factors that the inputs `x` and `y` reach.
    pub fn reached(&self, [x, y]: [Range<usize>; 2]) -> [Range<usize>; 2] {
        [self.x.reached(x), self.y.reached(y)]
    }

    /// Planes of the input that the planes `x` of the output are made of.
    pub fn read_by(&self, x: Range<usize>) -> Range<usize> {
        self.x.support(x)
    }

    /// The same of a box of outputs only, whole along z: those bits that [`apply`](Self::apply) writes there.
    pub fn apply_on(
        &self,
        [xs, ys]: [Range<usize>; 2],
        input: &[T],
        output: &mut [T],
        w: &mut TensorWorkspace<T>,
    ) {
        let ([_, iy, iz], [_, oy, oz]) = (self.input_dims(), self.output_dims());
        let (from_x, from_y) = (self.x.support(xs.clone()), self.y.support(ys.clone()));
        // Rows of y in a plane of which those from `first` on are there.
        let along_y = |plane: &[T], first: usize, line: usize, out: &mut [T]| {
            for (j, out) in ys.clone().zip(out.chunks_exact_mut(line)) {
                let (begin, weights) = self.y.row(j);
                let at = begin.saturating_sub(first) * line;
                combine(weights, &plane[at..at + weights.len() * line], out);
            }
        };
        let width = ys.len();
        match self.order {
            Order::FastFirst => {
                let (lines, planes) = w.split(from_x.len() * from_y.len() * oz, from_x.len() * width * oz);
                vectorized(
                    #[inline(always)]
                    || {
                        let (rows, some) = (from_y.len() * oz, width * oz);
                        for (n, i) in from_x.clone().enumerate() {
                            let line = |j: usize| (i * iy + j) * iz;
                            let plane = &mut lines[n * rows..(n + 1) * rows];
                            self.z
                                .apply_lines(&input[line(from_y.start)..line(from_y.end)], plane);
                            along_y(plane, from_y.start, oz, &mut planes[n * some..(n + 1) * some]);
                        }
                        for i in xs.clone() {
                            let (begin, weights) = self.x.row(i);
                            let at = begin.saturating_sub(from_x.start) * width * oz;
                            let line = |j: usize| (i * oy + j) * oz;
                            let planes = &planes[at..at + weights.len() * width * oz];
                            combine(weights, planes, &mut output[line(ys.start)..line(ys.end)]);
                        }
                    },
                );
            }
            Order::SlowFirst => {
                let (planes, lines) = w.split(iy * iz, width * iz);
                vectorized(
                    #[inline(always)]
                    || {
                        for i in xs.clone() {
                            let (begin, weights) = self.x.row(i);
                            let at = begin * iy * iz;
                            combine(weights, &input[at..at + weights.len() * iy * iz], planes);
                            along_y(planes, 0, iz, lines);
                            let line = |j: usize| (i * oy + j) * oz;
                            self.z
                                .apply_lines(lines, &mut output[line(ys.start)..line(ys.end)]);
                        }
                    },
                );
            }
        }
    }
}
